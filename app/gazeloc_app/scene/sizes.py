"""How large markers are: as they are meant for a room, smaller on a scan of a chair, larger in a hall."""

from __future__ import annotations

import numpy as np

from gazeloc_core.arrays import Floats

ROOM_M = (4.0, 12.0)
"""Diagonals of rooms in which markers have the sizes that their layers name."""


def size_factor(low: Floats, high: Floats) -> float:
    """By what sizes of markers are multiplied in what lies between two corners (3,) in the frame `scan`."""
    diagonal = float(np.linalg.norm(np.subtract(high, low)))
    return float(np.clip(diagonal / np.clip(diagonal, *ROOM_M), 0.05, 20.0))
