"""The corners of tags as features of the reconstruction, features that carry their names.

Each is given a descriptor that only the same corner of the same tag has, so that the ordinary matcher pairs it over the
whole recording, and the ordinary verification drops it where it contradicts the rest.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gazeloc_core.arrays import Floats, Ints

_CODE_LENGTH = 24
_CODE_VALUE = 104
"""SIFT descriptors of COLMAP have a length of 512, in bytes: 24 times 104 squared is 510 squared."""


def corner_descriptors(tag_id: Ints) -> NDArray[np.uint8]:
    """Descriptors (4 S, 128) of the corners of tags (S,): equal for the same corner of the same id, else far apart.

    Two codes share 4 or 5 of their 24 places on average.
    """
    codes = np.zeros((4 * len(tag_id), 128), dtype=np.uint8)
    for row, (tag, corner) in enumerate((tag, corner) for tag in tag_id.tolist() for corner in range(4)):
        places = np.random.default_rng([tag, corner]).permutation(128)[:_CODE_LENGTH]
        codes[row, places] = _CODE_VALUE
    return codes


def corner_keypoints(corners_px: Floats) -> NDArray[np.float32]:
    """COLMAP keypoints (4 S, 6) of corners (S, 4, 2): place, and an affine shape of 2 px that matching does not use."""
    pixels = corners_px.reshape(-1, 2)
    shape = np.tile([2.0, 0.0, 0.0, 2.0], (len(pixels), 1))
    return np.asarray(np.hstack([pixels, shape]), dtype=np.float32)
