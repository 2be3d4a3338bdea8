"""What a frame's pose rests on, in words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gazeloc_core.sfm_model import TrackedFrames


def tag_support_text(columns: Mapping[str, NDArray[Any]] | None, frame: int) -> str:
    """A sentence about a pose that tags alone gave (see `ProjectData.tag_columns`); "" for others and without pose."""
    if columns is None or frame >= len(columns["tags_used"]):
        return ""
    used, off_m = int(columns["tags_used"][frame]), float(columns["disagreement_m"][frame])
    if used == 0:
        return "Its tag has two possible poses." if bool(columns["is_ambiguous"][frame]) else ""
    return f"Rests on {used} tag{'s' if used > 1 else ''}; the worst is {100 * off_m:.1f} cm from its place."


def track_support_text(tracked: TrackedFrames | None, frame: int) -> str:
    """A sentence about a tracked frame; "" where the largest piece has not tracked it."""
    row = -1 if tracked is None else int(np.searchsorted(tracked.frame_indices, frame))
    if tracked is None or row == len(tracked) or tracked.frame_indices[row] != frame:
        return ""
    return f"Rests on {tracked.points[row]} points of the keyframes around it, {tracked.error_px[row]:.1f} px off."
