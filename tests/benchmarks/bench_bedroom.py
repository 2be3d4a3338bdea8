"""The real bedroom: tags found against the hand-made list, at the shipped settings."""

from __future__ import annotations

from pathlib import Path

from bedroom import search_bedroom

Row = tuple[str, str, bool]


def bench_bedroom(room: Path) -> list[Row]:
    """Recall and false sightings, and the time that a picture takes."""
    seen = search_bedroom(room)
    return [
        (
            "bedroom: tags found against the hand-made list, shipped settings (>= 94 %, none false)",
            f"{seen.recall:.1%} ({seen.found} of {seen.listed}), {seen.false} false, {seen.ms_per_picture:.0f} ms each",
            seen.recall >= 0.94 and seen.false == 0,
        )
    ]
