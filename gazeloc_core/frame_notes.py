"""What goes beside frames' poses into files for other programs: people's marks, and the agreement with the scan."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from gazeloc_core.arrays import Floats
from gazeloc_core.marks import FrameMark, FrameMarks

COLUMNS = ("mark", "note", "agreement")


@dataclass(frozen=True, eq=False)
class FrameNotes:
    """The marks of one recording, and the agreement (N,) of its N frames, NaN where a frame has none, None unscored."""

    marks: FrameMarks = field(default_factory=FrameMarks)
    agreement: Floats | None = None

    def values(self, frame: int) -> dict[str, Any]:
        """What is known of a frame, by the names of `COLUMNS`; nothing of -1, an image of no frame."""
        found: dict[str, Any] = {}
        if (mark := self._by_frame.get(frame)) is not None:
            found |= {"mark": mark.mark.value, "note": mark.note}
        if self.agreement is not None and frame >= 0 and np.isfinite(self.agreement[frame]):
            found["agreement"] = round(float(self.agreement[frame]), 4)
        return found

    def cells(self, frame: int) -> list[str]:
        """The same as cells of a table, empty where nothing is known."""
        values = self.values(frame)
        return [str(values.get(name, "")) for name in COLUMNS]

    def sentence(self, frame: int) -> str:
        """The mark of a frame in words, "" without one."""
        mark = self._by_frame.get(frame)
        return "" if mark is None else f"marked {mark.mark.value}" + (f": {mark.note}" if mark.note else "")

    @cached_property
    def _by_frame(self) -> dict[int, FrameMark]:
        return {one.frame_index: one for one in self.marks.marks}
