"""Panel: every step that people took, the newest on top; a click goes back, or forward again, to any of them."""

from __future__ import annotations

from collections.abc import Callable

from viser import GuiApi

from gazeloc_app import widgets
from gazeloc_app.actions.action import Action
from gazeloc_app.actions.history import Redo, Undo
from gazeloc_app.annotation.history import History
from gazeloc_app.annotation.kinds import UNDONE
from gazeloc_app.annotation.steps import describe
from gazeloc_app.state import AppState

MAX_SHOWN = 60
"""Steps in the list, around the one in force; the others are reached by going on from there."""


class HistoryPanel:
    """The list of steps, undo and redo."""

    def __init__(self, gui: GuiApi, dispatch: Callable[[Action], None]):
        self._seen: History | None = None
        self._undo = gui.add_button("Undo the last step", hint="Ctrl+Z, in every tab.", color="gray")
        self._redo = gui.add_button("Redo", hint="Ctrl+Shift+Z or Ctrl+Y, in every tab.", color="gray")
        self._list = gui.add_html("")
        undo = gui.add_command("Undo", hotkey="Z", modifier="cmd/ctrl", icon=None)
        redo = gui.add_command("Redo", hotkey="Y", modifier="cmd/ctrl", icon=None)
        again = gui.add_command("Redo the step", hotkey="Z", modifier="cmd/ctrl+shift", icon=None)
        widgets.on_user(self._undo, lambda _: dispatch(Undo()), event="on_click")
        widgets.on_user(self._redo, lambda _: dispatch(Redo()), event="on_click")
        for command, action in ((undo, Undo()), (redo, Redo()), (again, Redo())):
            widgets.on_user(command, lambda _, action=action: dispatch(action), event="on_trigger")  # type: ignore[misc]

    def render(self, state: AppState) -> None:
        """Show the state's steps."""
        history = History.of(state)
        if self._seen is not None and history.is_same(self._seen):
            return
        self._seen = history
        widgets.set_property(self._undo, "disabled", not history.past)
        widgets.set_property(self._redo, "disabled", not history.future)
        widgets.set_content(self._list, widgets.box(_list_html(history)))


def _list_html(history: History) -> str:
    if len(history.annotations) == 1:
        return f"Nothing was changed yet. {UNDONE}"
    last = min(len(history.annotations), max(history.position + MAX_SHOWN // 2, MAX_SHOWN))
    first = max(0, last - MAX_SHOWN)
    rows = [_row_html(history, step) for step in range(first, last)]
    more = [f"<div>… {first} earlier steps</div>"] if first else []
    return f'<div class="gazeloc-steps" role="list">{"".join([*reversed(rows), *more])}</div>'


def _row_html(history: History, step: int) -> str:
    sentence = describe(history.annotations[step - 1], history.annotations[step]) if step else "The beginning"
    kind = "now" if step == history.position else "undone" if step > history.position else "done"
    current = ' aria-current="step"' if kind == "now" else ""
    count = len(history.annotations)
    return (
        f'<button type="button" role="listitem" class="gazeloc-step gazeloc-{kind}"{current} title="Go to this step" '
        f"onclick=\"gazeloc.ask('go-to-step',{{step:{step},count:{count}}})\">"
        f"<span>{step}</span> {widgets.text(sentence)}</button>"
    )
