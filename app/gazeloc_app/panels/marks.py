"""Widgets: what a person thinks of the frame that is shown, by button or key, with a note."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from viser import GuiApi

from gazeloc_app import widgets
from gazeloc_app.actions.action import Action
from gazeloc_app.actions.marks import MarkFrame, NoteFrame
from gazeloc_app.frames.timeline_html import MARK_SIGNS
from gazeloc_app.state import AppState
from gazeloc_core.frames.marks import Mark

_KEYS: dict[Mark, Any] = {Mark.GOOD: "G", Mark.BAD: "B", Mark.UNSURE: "U"}
_LABELS = {f"{MARK_SIGNS[mark]} {mark.value.capitalize()} ({_KEYS[mark]})": mark for mark in Mark}


class MarkWidgets:
    """Three buttons, three keys and the note; what the frame's mark is, the panel says."""

    def __init__(self, gui: GuiApi, dispatch: Callable[[Action], None]):
        self._dispatch = dispatch
        self._frame = 0
        self._buttons = gui.add_button_group(
            "This frame is", tuple(_LABELS), hint="The same again takes the mark away. Exports carry marks and notes."
        )
        self._note = gui.add_text("Note", "", hint="Of this frame; one that nobody marked becomes unsure.")
        widgets.on_user(self._buttons, lambda event: self._mark(str(event.target.value)), event="on_click")
        widgets.on_user(self._note, lambda event: dispatch(NoteFrame(self._frame, str(event.target.value))))
        for mark, key in _KEYS.items():
            command = gui.add_command(f"Mark the frame {mark.value}", hotkey=key)
            widgets.on_user(command, partial(_mark, dispatch, mark), event="on_trigger")

    def render(self, state: AppState) -> None:
        """Show the note of the state's frame."""
        found = state.annotation.marks.get(state.frame)
        if self._frame != state.frame or self._note.value.split() != (found.note if found else "").split():
            self._frame = state.frame
            widgets.set_value(self._note, found.note if found else "")

    def _mark(self, label: str) -> None:
        if label in _LABELS:
            self._dispatch(MarkFrame(_LABELS[label]))


def _mark(dispatch: Callable[[Action], None], mark: Mark, event: Any) -> None:
    del event
    dispatch(MarkFrame(mark))
