"""Colours that tell things apart."""

from __future__ import annotations

import numpy as np

from gazeloc_core.arrays import Bytes, Ints

_GOLDEN = 0.381966
"""The golden ratio's share keeps the hues of neighbouring numbers apart."""


def colors_of_ids(ids: Ints) -> Bytes:
    """A strong colour (N, 3) for each number (N,), the same for the same number."""
    offsets = np.array([0.0, 2 / 3, 1 / 3])
    hue = np.asarray(ids, dtype=np.float64) * _GOLDEN % 1.0
    values = np.abs((hue[:, None] + offsets) % 1.0 * 6 - 3) - 1
    return np.asarray(np.clip(values, 0, 1) * 200 + 20, dtype=np.uint8)
