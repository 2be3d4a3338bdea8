"""Panel: the clicked keypoint pairs with their residuals, and what can be done to them."""

from __future__ import annotations

from collections.abc import Callable

from viser import GuiApi

from gazeloc_app import widgets
from gazeloc_app.actions.action import Action
from gazeloc_app.actions.history import Redo, Undo
from gazeloc_app.actions.pairs import DeletePair, EnablePair, RenamePair, SelectPair
from gazeloc_app.data import ProjectData
from gazeloc_app.keypoints.residuals import PairResidual, pair_residuals
from gazeloc_app.state import AppState
from gazeloc_core.keypoints import KeypointPair, Point, Sighting

NEW = "(a new pair)"
RULES = (
    "<b>Good keypoints</b>: things that are distinct in both; the middle of a thing, not its rim "
    "(reconstructions blur edges); far apart from each other, in all directions. Three pairs at least, six are better."
)

NONE_YET = widgets.card(
    "No keypoint yet.",
    "Hold Shift and click a spot on the scan, then that spot in two keyframes in the panel “Frame”, or among the "
    "points of the reconstruction. “A click” above says what a click does.",
)
LEGEND = (
    f'<div style="color:{widgets.MUTED}">cm and px: how far the two sides are apart. left out: the same in cm where '
    "the others alone decide. moves: by how many cm the cameras move without the pair. ✗: it disagrees, not used.</div>"
)


class KeypointPanel:
    """The table of pairs, the selection, and undo and redo."""

    def __init__(self, gui: GuiApi, state: AppState, data: ProjectData, dispatch: Callable[[Action], None]):
        self._data = data
        self._dispatch = dispatch
        self._state = state
        self._seen: object = None
        gui.add_html(widgets.box(RULES))
        self._table = gui.add_html("")
        self._selected = gui.add_dropdown("Selected", (NEW,), hint="The next click completes this pair.")
        self._name = gui.add_text("Name", "", visible=False, hint="What it is, e.g. “corner of the desk”.")
        self._enabled = gui.add_checkbox(
            "Counts", True, visible=False, hint="Whether the pair takes part in the alignment."
        )
        self._delete = gui.add_button(
            "Delete the pair", color="red", visible=False, hint="Both its sides; Undo brings it back."
        )
        self._steps = gui.add_button_group("", ("Undo", "Redo"), hint="Ctrl Z and Ctrl Y do the same.")
        widgets.on_user(self._selected, lambda event: dispatch(SelectPair(self._key_of(str(event.target.value)))))
        widgets.on_user(
            self._name, lambda event: self._if_selected(lambda key: RenamePair(key, str(event.target.value)))
        )
        widgets.on_user(
            self._enabled, lambda event: self._if_selected(lambda key: EnablePair(key, bool(event.target.value)))
        )
        widgets.on_user(self._delete, lambda _: self._if_selected(DeletePair), event="on_click")
        widgets.on_user(
            self._steps,
            lambda event: dispatch(Undo() if event.target.value == "Undo" else Redo()),
            event="on_click",
        )

    def render(self, state: AppState) -> None:
        """Show the state's pairs."""
        self._state = state
        seen = (state.annotation, state.selected_key, state.recording, state.data_revision)
        if seen == self._seen:
            return
        self._seen = seen
        keypoints = state.annotation.keypoints
        residuals = pair_residuals(self._data, state)
        rows = [_row(pair, residuals.get(pair.key), pair.key == state.selected_key) for pair in keypoints]
        head = ["", "Name", "Scan", "SfM", "cm", "px", "left out", "moves"]
        table = f"{widgets.html_table(head, rows)}{LEGEND if residuals else ''}" if rows else NONE_YET
        widgets.set_content(self._table, widgets.box(f'<div id="gazeloc-pairs">{table}</div>'))
        selected = keypoints.get(state.selected_key) if state.selected_key else None
        options = (NEW, *(_label(pair) for pair in keypoints))
        if tuple(self._selected.options) != options:
            self._selected.options = options
        widgets.set_value(self._selected, _label(selected) if selected else NEW)
        for handle in (self._name, self._enabled, self._delete):
            widgets.set_property(handle, "visible", selected is not None)
        widgets.set_value(self._name, selected.name if selected else "")
        widgets.set_value(self._enabled, selected.enabled if selected else True)

    def _key_of(self, label: str) -> str | None:
        return None if label == NEW else label.split(" · ")[0]

    def _if_selected(self, make: Callable[[str], Action]) -> None:
        if self._state.selected_key is not None:
            self._dispatch(make(self._state.selected_key))


def _label(pair: KeypointPair) -> str:
    return f"{pair.key} · {pair.name}"


def _side(point: Point | None, sightings: tuple[Sighting, ...]) -> str:
    views = f"{len(sightings)} views" if sightings else ""
    return " ".join(part for part in ("✓" if point is not None else "", views) if part) or "–"


def _row(pair: KeypointPair, residual: PairResidual | None, is_selected: bool) -> list[str]:
    color = "inherit" if pair.enabled else widgets.MUTED
    name = widgets.colored(pair.name, color)
    return [
        "▸" if is_selected else "",
        f"<b>{name}</b>" if is_selected else name,
        _side(pair.scan, pair.scan_sightings),
        _side(pair.sfm, pair.sightings),
        *_numbers(residual),
    ]


def _numbers(residual: PairResidual | None) -> list[str]:
    if residual is None:
        return ["", "", "", ""]
    distance = f"{100 * residual.distance_m:.1f}"
    return [
        distance if residual.is_used else f"{widgets.colored(distance, widgets.BAD)} ✗",
        f"{residual.pixels:.0f}" if residual.pixels is not None else "",
        _cm(residual.left_out_m),
        _cm(residual.cameras_move_m),
    ]


def _cm(value_m: float | None) -> str:
    return "" if value_m is None else f"{100 * value_m:.1f}"
