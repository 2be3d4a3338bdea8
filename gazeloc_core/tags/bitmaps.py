"""Printed AprilTags, cell by cell, as the AprilTag library itself would draw them (by pyapriltags).

tag36h11              tagStandard41h12
. . . . . . . . . .   d d d d d d d d d      .  white      #  black      d  data
. # # # # # # # # .   d # # # # # # # d
. # d d d d d d # .   d # . . . . . # d      The detector reports the corners of the square between # and the
. # d d d d d d # .   d # . d d d . # d      white ring: outside of # for tag36h11 and its kin, inside of #
. # d d d d d d # .   d # . d d d . # d      for the Standard, Circle and Custom families.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from pyapriltags.apriltags import Detector, _image_u8_get_array, _ImageU8

from gazeloc_core.arrays import Bools, frozen
from gazeloc_core.errors import InputError
from gazeloc_core.tags.detection import TagOptions, family_of


@dataclass(frozen=True, eq=False)
class TagBitmap:
    """One tag of N by N cells: `is_white` (N, N), rows from the top; ink is the rest.

    `outside` is how many cells per side lie outside of the square that the detector reports, `across` how many cells
    that square has: the tag size in cells. `is_size_outer` says whether this square is the outer edge of the black
    ring; else it is its inner edge.
    """

    is_white: Bools
    outside: int
    across: int
    is_size_outer: bool

    def __post_init__(self) -> None:
        object.__setattr__(self, "is_white", frozen(self.is_white, np.bool_))


def tag_bitmap(family: str, tag_id: int) -> TagBitmap:
    """The cells of a tag, with the ring of white cells around it where the family has one.

    Cells that carry nothing (around a tagCircle) are white.

    Raises:
        InputError: if the family is unknown or has no such id.
    """
    count = family_of(TagOptions(family=family)).ids
    if not 0 <= tag_id < count:
        raise InputError(f"{family} has no tag {tag_id}; its ids are 0 to {count - 1}.")
    library, described = _family(family)
    shape = described.contents
    picture = library.apriltag_to_image(described, tag_id)
    is_white = _image_u8_get_array(picture)[:, : picture.contents.width] > 0
    is_white = is_white.copy()
    library.image_u8_destroy(picture)
    outside = (shape.total_width - shape.width_at_border) // 2
    return TagBitmap(is_white | ~_carries(shape, outside), outside, shape.width_at_border, not shape.reversed_border)


@lru_cache
def _family(family: str) -> tuple[Any, Any]:
    """The shared library and its description of a family, made once and kept."""
    library: Any = Detector(families="").libc
    library.apriltag_to_image.restype = ctypes.POINTER(_ImageU8)
    library.image_u8_destroy.argtypes = [ctypes.POINTER(_ImageU8)]
    return library, getattr(library, f"{family}_create")()


def _carries(shape: Any, outside: int) -> Bools:
    """The cells (N, N) that are data, part of the two rings, or inside of them."""
    cells = np.zeros((shape.total_width, shape.total_width), dtype=np.bool_)
    cells[outside - 1 : 1 - outside or None, outside - 1 : 1 - outside or None] = True
    for i in range(shape.nbits):
        cells[shape.bit_y[i] + outside, shape.bit_x[i] + outside] = True
    return cells
