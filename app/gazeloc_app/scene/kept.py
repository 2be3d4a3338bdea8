"""What cuts leave of the room: pure geometry, for everything that a click or a drag can mean."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gazeloc_core.arrays import Floats


@dataclass(frozen=True)
class Plane:
    """What is cut away: all points with `normal` · point > `offset`, in the frame `scan`, metres."""

    normal: tuple[float, float, float]
    offset: float

    def passed(self, start: Floats, ray: Floats) -> tuple[float, float]:
        """From where to where, in lengths of the ray, it runs through what is left; the second is less for nowhere."""
        room, slope = self.offset - float(np.dot(self.normal, start)), float(np.dot(self.normal, ray))
        if slope == 0:
            return (-np.inf, np.inf) if room >= 0 else (np.inf, -np.inf)
        return (-np.inf, room / slope) if slope > 0 else (room / slope, np.inf)


@dataclass(frozen=True)
class Kept:
    """What several planes leave, the room where there are none."""

    planes: tuple[Plane, ...] = ()

    def has(self, points_in_scan: ArrayLike) -> NDArray[np.bool_]:
        """Which of the points (..., 3) are left."""
        points = np.asarray(points_in_scan, dtype=np.float64)
        left = np.ones(points.shape[:-1], dtype=np.bool_)
        for plane in self.planes:
            left &= points @ np.array(plane.normal) <= plane.offset
        return left

    def begin(self, start: Floats, ray: Floats) -> Floats | None:
        """The first place (3,) on a ray that is left, before which it meets nothing; None where none is."""
        passed = [(0.0, np.inf), *(plane.passed(start, ray) for plane in self.planes)]
        first, last = max(begin for begin, _ in passed), min(end for _, end in passed)
        return start + first * ray if first <= last and np.isfinite(first) else None


EVERYTHING = Kept()
