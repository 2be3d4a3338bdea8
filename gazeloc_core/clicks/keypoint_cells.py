"""What the readers of files of keypoints share: names and places from text, and the sentence where they are none."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Literal

from gazeloc_core.errors import InputError
from gazeloc_core.keypoints import KeypointPair, Point

SideName = Literal["scan", "sfm"]
MOST_NAME = 60
FARTHEST = 1e6
"""Coordinates beyond this are not of a room, in whatever unit."""
REMEDY = "export it again, or choose a file of keypoints (JSON, CSV, CloudCompare's list, Stray's keypoints.json)"


def one_sided(name: str, point: Point, side: SideName) -> KeypointPair:
    """A pair of which one side is known; its key comes later."""
    return KeypointPair("", name, scan=point) if side == "scan" else KeypointPair("", name, sfm=point)


def name_of(label: str, otherwise: str) -> str:
    """A label as a keypoint's name: one line, not too long, never empty."""
    return (" ".join(label.split()) or otherwise)[:MOST_NAME]


def point_of(file: str, where: str, values: Any) -> Point:
    """Three numbers as a place.

    Raises:
        InputError: with the file's name and `where` in it, if they are none or no place in a room.
    """
    if not isinstance(values, Sequence) or isinstance(values, str) or len(values) != 3:
        raise InputError.of(file, f"{where} has no three coordinates", REMEDY)
    try:
        x, y, z = (float(value) for value in values)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError.of(file, f"{where}: {values!r} are not three numbers"[:120], REMEDY) from error
    if not all(math.isfinite(value) and abs(value) <= FARTHEST for value in (x, y, z)):
        raise InputError.of(file, f"{where}: {values!r} is no place in a room"[:120], REMEDY)
    return x, y, z
