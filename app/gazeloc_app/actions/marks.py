"""What people say about the frame that is shown."""

from __future__ import annotations

from dataclasses import dataclass, replace

from gazeloc_app.state import AppState
from gazeloc_core.frames.marks import FrameMark, FrameMarks, Mark


@dataclass(frozen=True)
class MarkFrame:
    """The frame that is shown is good, bad or unsure; the mark that it has already is taken away."""

    mark: Mark

    def apply(self, state: AppState) -> AppState:
        """The state with the mark; a note stays with the frame when its mark changes."""
        marks = state.annotation.marks
        before = marks.get(state.frame)
        if before is not None and before.mark is self.mark:
            return _with_marks(state, marks.remove(state.frame))
        note = "" if before is None else before.note
        return _with_marks(state, marks.put(FrameMark(state.frame, self.mark, note)))


@dataclass(frozen=True)
class NoteFrame:
    """A frame got a note; a frame that nobody marked becomes unsure."""

    frame: int
    note: str

    def apply(self, state: AppState) -> AppState:
        """The state with the note; an empty one leaves an unmarked frame as it is."""
        marks = state.annotation.marks
        before = marks.get(self.frame)
        if before is None and not self.note.strip():
            return state
        mark = Mark.UNSURE if before is None else before.mark
        return _with_marks(state, marks.put(FrameMark(self.frame, mark, self.note)))


def _with_marks(state: AppState, marks: FrameMarks) -> AppState:
    return state.annotate(replace(state.annotation, marks=marks))
