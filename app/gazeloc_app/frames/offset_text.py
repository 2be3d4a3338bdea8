"""How far off a frame's camera looks, in words, with how well that is known (one standard deviation)."""

from __future__ import annotations

import numpy as np

from gazeloc_core.stages.scores import FrameScores

_WORTH_TELLING_M = 0.005


def offset_text(scores: FrameScores, frame: int) -> str:
    """The offset of a frame that has a score, and what the scan itself is off there where that is worth telling."""
    if not np.isfinite(scores.shift_m[frame]):
        return "It has too little in common with the scan seen from its pose to tell how far off that is."
    text = f"It looks {short_offset_text(scores, frame)}"
    if scores.scan_shift_m[frame] < _WORTH_TELLING_M:
        return f"{text}."
    return f"{text}, besides {100 * scores.scan_shift_m[frame]:.1f} cm by which the scan itself is off there."


def short_offset_text(scores: FrameScores, frame: int) -> str:
    """The offset alone, for lists."""
    if not np.isfinite(scores.shift_m[frame]):
        return "too far off to tell how far"
    shift_cm, shift_sigma_cm = 100 * scores.shift_m[frame], 100 * scores.shift_sigma_m[frame]
    turn_deg, turn_sigma_deg = scores.turn_deg[frame], scores.turn_sigma_deg[frame]
    return f"{shift_cm:.1f} ± {shift_sigma_cm:.1f} cm and {turn_deg:.1f} ± {turn_sigma_deg:.1f}° off"
