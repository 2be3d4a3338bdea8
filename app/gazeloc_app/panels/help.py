"""Panel: what mouse and keys do, the words of the field, and the look of the app."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from viser import GuiApi

from gazeloc_app import widgets
from gazeloc_app.annotation.kinds import UNDONE
from gazeloc_app.state import AppState

MOUSE = (
    ("drag", "turn the view"),
    ("right drag", "move the view"),
    ("wheel", "nearer, farther"),
    ("click", "what “A click” says, at the top right"),
    ("Shift click", "set a point: on the scan, in the panel “Frame”, or in the frame that is looked through"),
    ("Shift", "a lens at the pointer"),
    ("drag a marker", "move a keypoint: on the scan, in the reconstruction, or its click in the panel “Frame”"),
    ("Ctrl K", "find a command by its name"),
)
NAMES = {"arrowleft": "←", "arrowright": "→", "arrowup": "↑", "arrowdown": "↓"}
WORDS = (
    ("scan", "the room as the phone measured it; in metres, its axes are never changed"),
    ("recording", "what the glasses recorded: frames, gaze, times"),
    (
        "reconstruction",
        "the recording's cameras and points of the room, found from its frames alone (SfM); no scale yet",
    ),
    ("alignment", "the scale, turn and shift that put the reconstruction onto the scan"),
    ("keypoint", "one spot of the room, clicked on both sides"),
    ("tag", "an AprilTag on a wall: a keypoint that is found by itself"),
    ("pose", "where a frame's camera was, and where it looked"),
    ("registered", "a frame whose pose was found from its own picture"),
    ("residual", "how far the two sides of a keypoint are apart once aligned"),
    ("left out", "the same where the other keypoints alone decide: the honest number"),
)


class HelpPanel:
    """The keys are those of the commands that the app has registered: none is forgotten, none is made up."""

    def __init__(self, gui: GuiApi, toggle_look: Callable[[int], None]):
        """`toggle_look(client_id)` changes one browser between light and dark."""
        self._look = gui.add_button(
            "Light or dark", color="gray", hint="The look of the app in this browser, which remembers it."
        )
        self._keys = gui.add_html("")
        widgets.on_user(self._look, lambda event: toggle_look(event.client_id), event="on_click")
        self.show((gui,))

    def render(self, state: AppState) -> None:
        """Nothing of the help depends on the state."""

    def show(self, guis: Iterable[GuiApi]) -> None:
        """List the commands of these."""
        commands = {row[1]: row for gui in guis for row in commands_of(gui)}
        parts = [
            "<b>Mouse</b>" + _table(MOUSE),
            "<b>Keys</b>" + _table(sorted(commands.values(), key=_order)),
            f"<b>Undo</b><br>{widgets.text(UNDONE)}<br>",
            "<b>Words</b>" + _table(WORDS, is_key=False),
        ]
        widgets.set_content(self._keys, widgets.box("<br>".join(parts)))


def commands_of(gui: GuiApi) -> list[tuple[str, str]]:
    """Key and meaning of every command that was registered; a dash for those without a key."""
    handles: Iterable[Any] = tuple(gui._command_handle_from_uuid.values())
    return [(_keys(handle), f"{handle.label}{_more(handle)}") for handle in handles]


def _order(row: tuple[str, str]) -> tuple[bool, bool, str]:
    """Single keys by what they do, then the eight arrows, then what has no key."""
    key, meaning = row
    return key == "–", any(arrow in key for arrow in NAMES.values()), meaning


def _keys(command: Any) -> str:
    if command.hotkey is None:
        return "–"
    modifiers = {"cmd/ctrl": "Ctrl", "alt": "Alt", "shift": "Shift"}
    parts = [modifiers[part] for part in (command.modifier or "").split("+") if part]
    return " ".join([*parts, NAMES.get(command.hotkey, str(command.hotkey).capitalize())])


def _more(command: Any) -> str:
    return f": {command.description}" if command.description else ""


def _table(rows: Iterable[tuple[str, str]], *, is_key: bool = True) -> str:
    cells = [
        [f"<kbd>{widgets.text(name)}</kbd>" if is_key else f"<i>{widgets.text(name)}</i>", widgets.text(meaning)]
        for name, meaning in rows
    ]
    return widgets.html_table(("", ""), cells)
