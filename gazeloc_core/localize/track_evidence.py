"""Whether a pose that was measured from carried points is believed: enough points, all over the picture, no leap."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from scipy.spatial.transform import RigidTransform

from gazeloc_core.arrays import Bools, Floats
from gazeloc_core.camera import Camera
from gazeloc_core.localize.frame_pose import FramePose
from gazeloc_core.transforms import rotation_angle_rad


class Refusal(StrEnum):
    """Why a frame was not tracked, in words."""

    LOST = "points lost"
    FEW = "few points agree"
    ONE_PLACE = "points in one place"
    LEAP = "leap"


@dataclass(frozen=True, kw_only=True)
class EvidenceOptions:
    """What it takes to believe a pose."""

    least_points: int = 25
    """So many points must agree with it."""
    least_share: float = 0.5
    """And so large a share of the points from the earlier or of those from the later image, unless `least_points` from
    each agree: two ways that meet in one pose did not go astray together."""
    grid: int = 4
    """The picture is cut into so many columns and rows."""
    least_cells: int = 5
    """In so many of these cells points must agree."""
    fastest_deg_per_s: float = 600.0
    """A head turns no faster than this from the nearest known pose."""
    fastest_depths_per_s: float = 2.0
    """And moves no further in a second than this many times the distance to what it sees."""


@dataclass(frozen=True, eq=False)
class KnownPose:
    """A pose in the reconstruction that is known, and how far away in time the frame in question is."""

    sfm_from_camera: RigidTransform
    apart_s: float


def refusal(
    found: FramePose | None,
    camera: Camera,
    pixels: Floats,
    points: Floats,
    is_from_before: Bools,
    known: Sequence[KnownPose],
    options: EvidenceOptions,
) -> Refusal | None:
    """Why the pose that was found for `points` (N, 3) in sfm at `pixels` (N, 2) is not believed; None if it is.

    `is_from_before` (N,) tells the points of the image before from those of the image after. Where a track went wrong
    on one side, those of the other side still agree among themselves. `known` are poses nearby in time.
    """
    if found is None:
        return Refusal.LOST
    agrees = found.agrees
    sides = [agrees[is_from_before], agrees[~is_from_before]]
    share = max(float(side.mean()) for side in sides if len(side))
    do_meet = min(int(side.sum()) for side in sides) >= options.least_points
    if agrees.sum() < options.least_points or (share < options.least_share and not do_meet):
        return Refusal.FEW
    cells = np.floor(pixels[agrees] / [camera.width, camera.height] * options.grid).astype(np.int64)
    if len(np.unique(np.clip(cells, 0, options.grid - 1), axis=0)) < options.least_cells:
        return Refusal.ONE_PLACE
    depth = float(np.median(np.linalg.norm(points[agrees] - found.world_from_camera.translation, axis=1)))
    return Refusal.LEAP if any(_is_leap(found, other, depth, options) for other in known) else None


def _is_leap(found: FramePose, other: KnownPose, depth: float, options: EvidenceOptions) -> bool:
    here, there = found.world_from_camera, other.sfm_from_camera
    turned_deg = np.degrees(float(rotation_angle_rad(here.rotation, there.rotation)))
    moved = float(np.linalg.norm(here.translation - there.translation))
    return bool(
        turned_deg > options.fastest_deg_per_s * other.apart_s
        or moved > options.fastest_depths_per_s * depth * other.apart_s
    )
