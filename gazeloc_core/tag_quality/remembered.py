"""What single tags are worth costs minutes to try out and is the same every time: it is kept in a folder."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from gazeloc_core.errors import GazelocError
from gazeloc_core.progress import Report, silent
from gazeloc_core.storage.artifacts import Artifact
from gazeloc_core.storage.hashing import hash_of_value
from gazeloc_core.tag_quality.safe_range import TRIALS_VERSION, SafeRangeOptions, TagQuality, tag_quality, try_tags


def remembered_quality(folder: Path, options: SafeRangeOptions, report: Report = silent) -> TagQuality:
    """`tag_quality` on a grid, from `folder` where it was tried out before, else tried now and kept there.

    Raises:
        InputError: if the grid is impossible (`try_tags`).
        Cancelled: when `report` raises it.
    """
    artifact = Artifact(folder / f"tag-quality-{hash_of_value([TRIALS_VERSION, asdict(options)])}")
    if artifact.exists:
        try:
            return TagQuality(**artifact.read_arrays())
        except (GazelocError, TypeError):
            pass  # damaged: made anew
    quality = tag_quality(try_tags(options, report))
    artifact.write_arrays(vars(quality), options={}, inputs={})
    return quality
