"""The motion of the camera that explains how a frame's tiles lie against the render from its pose.

A tile at X in the camera moves in the picture when the camera turns by w and moves by t, since X goes by -w x X - t,
and when the scan is off by d there, as X goes by d. For small ones both are linear: a tile gives up to two equations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import RigidTransform

from gazeloc_core.arrays import Floats
from gazeloc_core.camera import Camera
from gazeloc_core.evaluation.picture_tiles import Tiles

_MIN_TILES = 8
_ROUNDS = 10


@dataclass(frozen=True, eq=False)
class TileEquations:
    """What T tiles say: sharpness · shift = `by_motion` · (w, t) + `by_place` · d, in pixels.

    `place_in_scan` (T, 3) is where they lie on the scan; `shift` (T, 2), `by_motion` (T, 2, 6) and `by_place`
    (T, 2, 3) are multiplied by the tiles' sharpness: one with a straight edge knows its shift across the edge alone.
    (w, t) are in rad and m in the camera, d in m in the scan. `picture_deg` (T, 2, 6) is how a motion moves the tiles,
    in degrees, `px_deg` (T,) how large a pixel is there, and `weight` (T,) how well they fit.
    """

    place_in_scan: Floats
    shift: Floats
    by_motion: Floats
    by_place: Floats
    picture_deg: Floats
    px_deg: Floats
    weight: Floats

    def __len__(self) -> int:
        return len(self.weight)


def tile_equations(tiles: Tiles, camera: Camera, scan_from_camera: RigidTransform) -> TileEquations | None:
    """The equations of a render's tiles; None where too few of them show the scan to tell a motion by."""
    rays = camera.unproject(tiles.center_px)
    beside = [camera.unproject(tiles.center_px + step) - rays for step in ((0.5, 0.0), (0.0, 0.5))]
    per_px = 2 * np.stack(beside, axis=2)  # (T, 3, 2): how a ray changes by a pixel's step to the right and down
    known = np.isfinite(tiles.depth_m) & np.isfinite(rays).all(axis=1) & np.isfinite(per_px).all(axis=(1, 2))
    if known.sum() < _MIN_TILES:
        return None
    rays, per_px, sharpness = rays[known], per_px[known], tiles.sharpness[known]
    range_m = tiles.depth_m[known] / rays[:, 2]
    design = np.linalg.pinv(per_px) @ _moved_rays(rays, range_m)
    px_deg = np.degrees(np.linalg.norm(per_px, axis=1).mean(axis=1))
    rotation = scan_from_camera.rotation.as_matrix()
    by_motion = sharpness @ design
    return TileEquations(
        place_in_scan=(rays * range_m[:, None]) @ rotation.T + scan_from_camera.translation,
        shift=np.einsum("nij,nj->ni", sharpness, tiles.shift_px[known]),
        by_motion=by_motion,
        by_place=-by_motion[:, :, 3:] @ rotation.T,
        picture_deg=design * px_deg[:, None, None],
        px_deg=px_deg,
        weight=np.clip(tiles.best[known], 0, None) ** 2,
    )


def _moved_rays(rays: Floats, range_m: Floats) -> Floats:
    """How unit rays (T, 3) change, (T, 3, 6), when the camera turns by w (rad) and moves by t (m).

    The ray of a point changes by the part of the point's own motion across it, over the range.
    """
    across = np.eye(3) - rays[:, :, None] * rays[:, None, :]
    x, y, z = rays.T
    nil = np.zeros_like(x)
    crossed = np.stack([nil, -z, y, z, nil, -x, -y, x, nil], axis=1).reshape(-1, 3, 3)
    return np.concatenate([across @ crossed, -across / range_m[:, None, None]], axis=2)


@dataclass(frozen=True, eq=False)
class Motion:
    """The camera's apparent motion from its pose: `value` (6,), w in rad and t in m in the camera; its `covariance`
    (6, 6), by the scatter of the tiles alone; and what is `left` (T,) of their shifts, in px."""

    value: Floats
    covariance: Floats
    left: Floats


def apparent_motion(equations: TileEquations, displacement_m: Floats | None = None, overlap: float = 1.0) -> Motion:
    """The motion that explains most tiles, where the scan is off by `displacement_m` (T, 3) at them.

    Least squares with Cauchy weights, with a scale from the median of what is left, which keeps strays out. `overlap`
    is how many tiles tell one and the same thing.
    """
    wanted = equations.shift
    if displacement_m is not None:
        wanted = wanted - np.einsum("nij,nj->ni", equations.by_place, displacement_m)
    weight, seen, value = equations.weight, equations.by_motion, np.zeros(6)
    normal: Floats = np.eye(6)
    left, scale = np.zeros(len(weight)), 1.0
    for _ in range(_ROUNDS):
        normal = np.einsum("n,nij,nik->jk", weight, seen, seen)
        normal += 1e-6 * np.trace(normal) * np.eye(6)
        value = np.linalg.solve(normal, np.einsum("n,nij,ni->j", weight, seen, wanted))
        left = np.linalg.norm(wanted - seen @ value, axis=1)
        scale = robust_scale(left)
        weight = equations.weight / (1 + (left / scale) ** 2)
    return Motion(value, np.asarray(np.linalg.inv(normal) * scale**2 * overlap), left)


def robust_scale(left_px: Floats) -> float:
    """The scale (px) beyond which what is left of a tile's shift counts ever less."""
    return max(1.48 * float(np.median(left_px)), 0.05)
