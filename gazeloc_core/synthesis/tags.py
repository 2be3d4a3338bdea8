"""AprilTags on the surfaces of a made-up room: their pictures, and where their corners truly are.

Corners are those that the AprilTag library reports, the outer edge of the black border, in its order:

        4 (index 3) ------- 3 (index 2)      seen from the front, the tag hanging upright
            |                   |
        1 (index 0) ------- 2 (index 1)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from gazeloc_core.arrays import Bytes, Floats, frozen
from gazeloc_core.synthesis.geometry import Patch, quad
from gazeloc_core.synthesis.textures import picture
from gazeloc_core.tags.bitmaps import tag_bitmap

FAMILY = "tag36h11"
MODULES = 8
"""Cells across the black square, border included."""
PAPER_MODULES = 10.5
"""Cells across the white paper."""
PIXELS_PER_MODULE = 40


@dataclass(frozen=True, eq=False)
class PlacedTag:
    """A tag of the room: `corners` (4, 3) in the detector's order, in metres."""

    tag_id: int
    corners: Floats

    def __post_init__(self) -> None:
        object.__setattr__(self, "corners", frozen(self.corners))


def tag_image(tag_id: int) -> Bytes:
    """A printed tag36h11 with its white margin, upright as the AprilTag library sees it, (N, N, 3) sRGB."""
    ring = slice(1, 1 + MODULES)  # without the white cells around it
    cells = tag_bitmap(FAMILY, tag_id).is_white[ring, ring].repeat(PIXELS_PER_MODULE, 0).repeat(PIXELS_PER_MODULE, 1)
    margin = int((PAPER_MODULES - MODULES) / 2 * PIXELS_PER_MODULE)
    gray = np.where(np.pad(cells, margin, constant_values=True), 236, 22).astype(np.uint8)
    return np.repeat(gray[..., None], 3, axis=2)


def place(tag_id: int, center: ArrayLike, rotation: Rotation, size_m: float) -> tuple[Patch, PlacedTag]:
    """The paper with a tag on it, and its corners; unturned, the tag looks along +z with its top towards +y."""
    frame, c = rotation.as_matrix(), np.asarray(center, dtype=np.float64)
    right, up, out = frame.T
    half = size_m / 2 * PAPER_MODULES / MODULES
    lifted = c + 0.002 * out
    paper = quad(
        f"tag{tag_id}",
        lifted - half * right + half * up,
        2 * half * right,
        -2 * half * up,
        picture(tag_image(tag_id), 2 * half, 2 * half),
        texel_m=size_m / (MODULES * 16),
    )
    signs = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * size_m / 2
    return paper, PlacedTag(tag_id, lifted + signs[:, :1] * right + signs[:, 1:] * up)
