"""Clicks near a tag's centre or corner mean that very place, which both sides know far better than a click hits it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gazeloc_app.keypoints.picking import angles_to_ray
from gazeloc_app.scene.kept import EVERYTHING, Kept
from gazeloc_core.arrays import Floats
from gazeloc_core.tag_types import TagCorners
from gazeloc_core.transforms import Similarity

NEAR_PX = 10.0
"""How far beside it on the screen a click may be."""
BEHIND_M = 0.1
"""How far behind the place that was clicked a tag's may lie, and not be hidden by it."""


@dataclass(frozen=True, eq=False)
class Snapped:
    """A tag's place: `point` (3,) in the frame of the tags that were given, and what it is, e.g. “Tag 3, corner 2”."""

    point: Floats
    name: str


def snap(
    tags: TagCorners | None,
    scan_from_tags: Similarity,
    origin: Floats,
    direction: Floats,
    tolerance_rad: float,
    hit_in_scan: Floats | None = None,
    kept: Kept = EVERYTHING,
) -> Snapped | None:
    """The tag's centre or corner that the ray in the frame `scan` passes best, within the tolerance; None for none.

    `hit_in_scan` is what the ray met: what lies farther behind it is hidden and not meant, nor is what is cut away.
    """
    if tags is None or len(tags) == 0:
        return None
    points = np.concatenate([tags.centers[:, None], tags.corners], axis=1).reshape(-1, 3)
    in_scan = scan_from_tags.apply(points)
    angles, along = angles_to_ray(in_scan, origin, direction)
    is_near = (angles <= tolerance_rad) & (along > 0) & kept.has(in_scan)
    if hit_in_scan is not None:
        is_near &= along <= float(np.linalg.norm(np.asarray(hit_in_scan) - origin)) + BEHIND_M
    if not is_near.any():
        return None
    best = int(np.where(is_near, angles, np.inf).argmin())
    tag, part = divmod(best, 5)
    return Snapped(points[best], f"Tag {int(tags.tag_id[tag])}, {'centre' if part == 0 else f'corner {part}'}")
