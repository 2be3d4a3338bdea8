"""Points carried from one picture to the next: pyramidal Lucas-Kanade (Bouguet 2000), as OpenCV has it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from gazeloc_core.arrays import Bools, Bytes, Floats
from gazeloc_core.camera import HALF_PIXEL


@dataclass(frozen=True, kw_only=True)
class FlowOptions:
    """How points are carried."""

    window_px: int = 21
    """Side of the square around a point that is looked for in the next picture."""
    levels: int = 4
    """How often the pictures are halved: with 21 px and 4 levels, movements of up to some 150 px are followed."""
    iterations: int = 20
    """At most so many steps at each size."""
    step_px: float = 0.03
    """Steps shorter than this end the search."""


def carry(before: Bytes, after: Bytes, pixels: Floats, options: FlowOptions) -> tuple[Floats, Bools]:
    """Where the points at `pixels` (N, 2) of one grey picture (H, W) are in another: (N, 2), and which were found (N,).

    A point is lost where there is no texture, or at the picture's edge. One that was carried to a wrong place is not
    noticed here: whoever knows the points in space sees that they do not move as one.
    """
    if len(pixels) == 0:
        return np.empty((0, 2)), np.empty(0, dtype=np.bool_)
    start = (pixels - HALF_PIXEL).astype(np.float32).reshape(-1, 1, 2)
    found, is_found, _ = cv2.calcOpticalFlowPyrLK(
        before,
        after,
        start,
        np.empty_like(start),
        winSize=(options.window_px, options.window_px),
        maxLevel=options.levels,
        criteria=(cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, options.iterations, options.step_px),
    )
    carried = found.reshape(-1, 2).astype(np.float64) + HALF_PIXEL
    height, width = after.shape
    inside = (carried >= 0).all(axis=1) & (carried <= [width, height]).all(axis=1)
    return carried, np.asarray((is_found.ravel() > 0) & inside, dtype=np.bool_)
