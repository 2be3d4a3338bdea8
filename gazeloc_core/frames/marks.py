"""Marks: what a person who looked at a frame against its render thinks of its pose, with a note."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np

from gazeloc_core.arrays import Bools
from gazeloc_core.errors import InputError

MAX_NOTE = 500
"""Letters of a note that are kept."""


class Mark(StrEnum):
    """What a person says about a frame's pose."""

    GOOD = "good"
    BAD = "bad"
    UNSURE = "unsure"


@dataclass(frozen=True)
class FrameMark:
    """One frame's mark."""

    frame_index: int
    mark: Mark
    note: str = ""


@dataclass(frozen=True)
class FrameMarks:
    """The marks of one recording by rising frame, at most one per frame. Methods return a changed set."""

    marks: tuple[FrameMark, ...] = ()

    def __len__(self) -> int:
        return len(self.marks)

    def get(self, frame_index: int) -> FrameMark | None:
        """A frame's mark, None where it has none."""
        return next((mark for mark in self.marks if mark.frame_index == frame_index), None)

    def put(self, mark: FrameMark) -> FrameMarks:
        """With a frame's mark set, in place of an earlier one. The note is one line of at most `MAX_NOTE` letters."""
        note = " ".join(mark.note.split())[:MAX_NOTE]
        others = self.remove(mark.frame_index).marks
        marks = (*others, FrameMark(mark.frame_index, mark.mark, note))
        return FrameMarks(tuple(sorted(marks, key=lambda one: one.frame_index)))

    def remove(self, frame_index: int) -> FrameMarks:
        """With a frame's mark taken away."""
        return FrameMarks(tuple(mark for mark in self.marks if mark.frame_index != frame_index))

    def have(self, mark: Mark, count: int) -> Bools:
        """Which of `count` frames have this mark, (count,)."""
        found = np.zeros(count, dtype=np.bool_)
        found[[one.frame_index for one in self.marks if one.mark is mark and one.frame_index < count]] = True
        return found

    def counts(self) -> dict[Mark, int]:
        """How many frames have each mark."""
        return {mark: sum(one.mark is mark for one in self.marks) for mark in Mark}

    def to_json(self) -> list[dict[str, Any]]:
        """A JSON array that `from_json` reads."""
        return [{"frame_index": one.frame_index, "mark": one.mark.value, "note": one.note} for one in self.marks]

    @classmethod
    def from_json(cls, values: Any) -> FrameMarks:
        """The set of `to_json`.

        Raises:
            InputError: if a field is missing or garbled.
        """
        marks = cls()
        try:
            for value in values:
                index = value["frame_index"]
                if not isinstance(index, int) or index < 0:
                    raise ValueError(f"{index!r} is not a frame's number")
                marks = marks.put(FrameMark(index, Mark(value["mark"]), str(value["note"])))
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"The marks of frames are garbled ({error}); restore the file from a backup.") from error
        return marks
