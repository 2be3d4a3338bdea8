"""A fixed sample of a point cloud, spread evenly over the space that the points take up.

Points are sorted along a Z-order curve (Morton 1966) through a grid, whose cells of any size 2^-k are then runs of
the sorted list. The coarsest cells give their first point each, then the next finer ones, until there are enough: so
places with few points keep them, and crowded places are thinned.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gazeloc_core.arrays import Floats, Ints

_BITS = 20
"""Cells along an axis, as a power of two: three axes fit into 64 bits."""


def even_sample(points: Floats, count: int) -> Ints:
    """The rows, in order, of at most `count` of the `points` (N, 3); the same for the same points.

    Points that are not finite come last. A million points take a fifth of a second.
    """
    if len(points) <= count:
        return np.arange(len(points), dtype=np.int64)
    code = _morton(points)
    order = np.argsort(code, kind="stable")
    code = code[order]
    chosen = np.zeros(len(points), dtype=bool)
    for level in range(_BITS, -1, -1):
        cell = code >> np.uint64(3 * level)
        first = np.concatenate([[True], cell[1:] != cell[:-1]])
        if first.sum() > count:
            return np.sort(order[_topped_up(chosen, first, count)])
        chosen = first  # the first of a cell is the first of one of its parts too
    return np.sort(order[_topped_up(chosen, np.ones(len(points), dtype=bool), count)])  # many points in one place


def _topped_up(chosen: NDArray[np.bool_], more: NDArray[np.bool_], count: int) -> NDArray[np.bool_]:
    """`chosen` and, evenly many along the curve, some of `more`, `count` in all."""
    others = np.flatnonzero(more & ~chosen)
    wanted = count - int(chosen.sum())
    result = chosen.copy()
    result[others[(np.arange(wanted) * len(others)) // wanted if wanted else []]] = True
    return result


def _morton(points: Floats) -> NDArray[np.uint64]:
    """The place (N,) of each point's cell on the curve."""
    finite = np.isfinite(points @ np.ones(3))
    inside = points if finite.all() else points[finite]
    if len(inside) == 0:
        return np.zeros(len(points), dtype=np.uint64)
    low, high = np.percentile(inside[:: max(1, len(inside) // 100_000)], [0.5, 99.5], axis=0)  # strays do not count
    cells = 1 << _BITS
    scale, middle = cells / (1.5 * max(float((high - low).max()), 1e-12)), (low + high) / 2
    code = np.zeros(len(points), dtype=np.uint64)
    for axis in range(3):
        place = np.clip((points[:, axis] - middle[axis]) * scale + cells / 2, 0, cells - 1)
        place[~finite] = cells - 1
        code |= _spread(place.astype(np.uint64)) << np.uint64(axis)
    return code


def _spread(value: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """The bits of numbers below 2^21, two zeros between them."""
    for shift, mask in (
        (32, 0x1F00000000FFFF),
        (16, 0x1F0000FF0000FF),
        (8, 0x100F00F00F00F00F),
        (4, 0x10C30C30C30C30C3),
        (2, 0x1249249249249249),
    ):
        value = (value | value << np.uint64(shift)) & np.uint64(mask)
    return value
