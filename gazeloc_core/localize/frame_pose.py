"""The pose of one camera from pixels of known points: LO-RANSAC, then a robust refinement through the real lens.

Both are COLMAP's (Schönberger and Frahm, CVPR 2016). Nothing is said to them about where the camera should be, so that
an expectation can be held against what they find.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pycolmap
from scipy.spatial.transform import RigidTransform, Rotation

from gazeloc_core.arrays import Bools, Floats
from gazeloc_core.camera import Camera
from gazeloc_core.transforms import rigid

LEAST_POINTS = 4
_SEED = 1


@dataclass(frozen=True, kw_only=True)
class FramePoseOptions:
    """What counts as agreement between a pixel and a pose."""

    agree_px: float = 3.0
    """A point agrees with a pose that puts it no further than this from its pixel."""
    soft_px: float = 0.5
    """Errors beyond this pull less and less in the refinement (Cauchy)."""
    most_trials: int = 200
    """Samples that RANSAC draws at most; where half of the points are wrong, 200 hit a right three for certain."""


@dataclass(frozen=True, eq=False)
class FramePose:
    """`world_from_camera`, and of the N points which agree with it `agrees` (N,) and how far off each is (N,), px."""

    world_from_camera: RigidTransform
    agrees: Bools
    error_px: Floats


def frame_pose(
    camera: Camera, pixels: Floats, points: Floats, options: FramePoseOptions | None = None
) -> FramePose | None:
    """The pose of the distorted `camera` that sees `points` (N, 3) in the world at `pixels` (N, 2).

    None where there is none: too few points, or no three of them that others agree with. The same for the same input.
    """
    options = options or FramePoseOptions()
    if len(pixels) < LEAST_POINTS:
        return None
    estimation = pycolmap.AbsolutePoseEstimationOptions()
    estimation.ransac.max_error = options.agree_px
    estimation.ransac.min_num_trials, estimation.ransac.max_num_trials = 20, options.most_trials
    estimation.ransac.confidence, estimation.ransac.random_seed = 0.999, _SEED
    refinement = pycolmap.AbsolutePoseRefinementOptions()
    refinement.loss_function_scale = options.soft_px
    found = pycolmap.estimate_and_refine_absolute_pose(pixels, points, camera.to_colmap(), estimation, refinement)
    if found is None:
        return None
    camera_from_world = found["cam_from_world"]
    matrix = camera_from_world.matrix()
    with np.errstate(invalid="ignore"):
        error_px = np.linalg.norm(camera.project(points @ matrix[:, :3].T + matrix[:, 3]) - pixels, axis=1)
    error_px = np.nan_to_num(error_px, nan=np.inf)
    inverse = camera_from_world.inverse()
    pose = rigid(Rotation.from_quat(inverse.rotation.quat), inverse.translation, "a frame's pose")
    return FramePose(pose, np.asarray(error_px <= options.agree_px), np.asarray(error_px))
