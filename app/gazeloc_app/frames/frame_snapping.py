"""Clicks near a tag that was found in a frame mean its centre or corner, known to a part of a pixel."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gazeloc_core.arrays import Floats
from gazeloc_core.tag_types import TagSightings


class SnappedPixel(NamedTuple):
    """A tag's place in a frame, and what it is, e.g. “Tag 3, corner 2”."""

    x_px: float
    y_px: float
    name: str


def snap_pixel(tags: TagSightings | None, frame: int, pixel: Floats, reach_px: float) -> SnappedPixel | None:
    """The centre or corner of a tag of the frame that is nearest to the pixel (2,), within the reach; None for none."""
    here = [] if tags is None else np.flatnonzero(tags.frame_index == frame).tolist()
    if tags is None or not here:
        return None
    points = np.concatenate([np.vstack([_centre(tags.corners_px[row]), tags.corners_px[row]]) for row in here])
    away = np.linalg.norm(points - np.asarray(pixel), axis=1)
    best = int(away.argmin())
    if not away[best] <= reach_px:
        return None
    row, part = divmod(best, 5)
    what = "centre" if part == 0 else f"corner {part}"
    x_px, y_px = points[best].tolist()
    return SnappedPixel(x_px, y_px, f"Tag {int(tags.tag_id[here[row]])}, {what}")


def _centre(corners: Floats) -> Floats:
    """Where the diagonals cross: the picture of the square's centre, which the corners' mean is not."""
    a, b, c, d = np.column_stack([corners, np.ones(4)])
    x, y, w = np.cross(np.cross(a, c), np.cross(b, d))
    return np.asarray(np.array([x, y]) / w, dtype=np.float64)
