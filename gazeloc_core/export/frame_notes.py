"""What goes beside frames' poses into files for other programs: people's marks, and how frames agree with the scan."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from gazeloc_core.arrays import Floats
from gazeloc_core.frames.marks import FrameMark, FrameMarks

_SCORES = {
    "agreement": "agreement",
    "shift_m": "shift [m]",
    "shift_sigma_m": "shift sigma [m]",
    "turn_deg": "turn [deg]",
    "turn_sigma_deg": "turn sigma [deg]",
}
HEADINGS = ("mark", "note", *_SCORES.values())
"""Of tables: what people said, how well the frame agrees with the scan (0 to 1), and how far off its camera looks."""


@dataclass(frozen=True, eq=False)
class FrameNotes:
    """The marks of one recording and, where its frames are scored, columns (N,) of scores, NaN where a frame has none.

    The scores are `agreement`, `shift_m`, `shift_sigma_m`, `turn_deg` and `turn_sigma_deg`: see `agreement.Agreement`.
    """

    marks: FrameMarks = field(default_factory=FrameMarks)
    scores: Mapping[str, Floats] = field(default_factory=dict)

    def values(self, frame: int) -> dict[str, Any]:
        """What is known of a frame; nothing of -1, an image of no frame."""
        found: dict[str, Any] = {}
        if (mark := self._by_frame.get(frame)) is not None:
            found |= {"mark": mark.mark.value, "note": mark.note}
        if frame < 0:
            return found
        known = {name: float(self.scores[name][frame]) for name in _SCORES if name in self.scores}
        return found | {name: round(value, 5) for name, value in known.items() if np.isfinite(value)}

    def cells(self, frame: int) -> list[str]:
        """The same as cells of a table under `HEADINGS`, empty where nothing is known."""
        values = self.values(frame)
        return [str(values.get(name, "")) for name in ("mark", "note", *_SCORES)]

    def sentence(self, frame: int) -> str:
        """The mark of a frame in words, "" without one."""
        mark = self._by_frame.get(frame)
        return "" if mark is None else f"marked {mark.mark.value}" + (f": {mark.note}" if mark.note else "")

    @cached_property
    def _by_frame(self) -> dict[int, FrameMark]:
        return {one.frame_index: one for one in self.marks.marks}
