"""How far off a frame's camera looks, in words."""

from __future__ import annotations

from gazeloc_core.stages.scores import FrameScores

_WORTH_TELLING_M = 0.005


def offset_text(scores: FrameScores, frame: int) -> str:
    """The offset of a frame that has a score, with how well it is known (one standard deviation)."""
    shift_cm, shift_sigma_cm = 100 * scores.shift_m[frame], 100 * scores.shift_sigma_m[frame]
    turn_deg, turn_sigma_deg = scores.turn_deg[frame], scores.turn_sigma_deg[frame]
    text = f"It looks {shift_cm:.1f} ± {shift_sigma_cm:.1f} cm and {turn_deg:.1f} ± {turn_sigma_deg:.1f}° off."
    if scores.scan_shift_m[frame] < _WORTH_TELLING_M:
        return text
    return f"{text[:-1]}, besides {100 * scores.scan_shift_m[frame]:.1f} cm by which the scan itself is off there."


def short_offset_text(scores: FrameScores, frame: int) -> str:
    """The offset alone, for lists."""
    return f"{100 * scores.shift_m[frame]:.1f} cm / {scores.turn_deg[frame]:.1f}°"
