"""Moments that belong together: the nearest of known times."""

from __future__ import annotations

import numpy as np

from gazeloc_core.arrays import Ints


def nearest_rows(wanted_ns: Ints, known_ns: Ints, tolerance_ns: int) -> Ints:
    """(N,) the row of the rising times `known_ns` nearest to each wanted time, -1 beyond the tolerance.

    Of two that are equally near, the earlier.
    """
    wanted, known = (np.asarray(times, dtype=np.int64) for times in (wanted_ns, known_ns))
    if len(known) == 0:
        return np.full(len(wanted), -1, dtype=np.int64)
    after = np.clip(np.searchsorted(known, wanted), 0, len(known) - 1)
    before = np.maximum(after - 1, 0)
    nearest = np.where(np.abs(known[before] - wanted) <= np.abs(known[after] - wanted), before, after)
    return np.asarray(np.where(np.abs(known[nearest] - wanted) <= tolerance_ns, nearest, -1), dtype=np.int64)
