"""Poses of cameras from squares whose places are known, many cameras at once (resection, PnP).

Gauss-Newton on the reprojection error, damped per camera (Levenberg). What a square's four corners are off by has two
parts: each corner's own error, and one that all four share, because the square's place is known to a centimetre only.
The shared part is weighed by itself, so that near squares, where a centimetre is many pixels, do not outvote far ones,
and so that it blurs neither the square's shape nor the choice between its two poses.

A pose that was reached from one square (its seed) takes another in as far as the two agree: weights of Geman and
McClure whose scale shrinks from round to round (Yang et al., "Graduated non-convexity", RA-L 2020).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from gazeloc_core.arrays import Bools, Floats, Ints

_SCALES = (8.0, 2.0, 1.0)
_ROUNDS = 10
_NEAREST_M = 0.05
_BEHIND_PX = 1e4


@dataclass(frozen=True, kw_only=True)
class TagErrors:
    """What is assumed about the errors of detected tags and of their places on the scan (standard deviations)."""

    corner_error_px: float = 0.7
    """Detected corners, per axis."""
    place_error_m: float = 0.01
    """Places of tags on the scan, per axis."""
    outlier: float = 4.0
    """A tag whose corners are off by more than this many times the errors above does not agree."""

    def weight(self, chi2: Floats, times: float = 1.0) -> Floats:
        """The weight of views with squared errors (V,), a quarter at `times` the outlier (Geman and McClure)."""
        limit = 8 * (self.outlier * times) ** 2
        return np.asarray((limit / (limit + chi2)) ** 2)

    def agrees(self, chi2: Floats) -> Bools:
        """Which views with squared errors (V,) are no outliers."""
        return np.asarray(chi2 <= 8 * self.outlier**2)


@dataclass(frozen=True, eq=False)
class SeenSquares:
    """V views: square after square as poses see it; `pose` (V,) rises.

    `corners` (V, 4, 3) in the frame `scan`; `normalised` (V, 4, 2) the rays' x/z and y/z; `focal_px` (2,);
    `is_seed` (V,) the view that a pose was reached from, whose weight stays 1.
    """

    pose: Ints
    corners: Floats
    normalised: Floats
    focal_px: Floats
    is_seed: Bools

    def __len__(self) -> int:
        return len(self.pose)

    def pick(self, which: ArrayLike) -> SeenSquares:
        """Some of the views."""
        chosen = np.asarray(which)
        columns = {name: getattr(self, name)[chosen] for name in ("pose", "corners", "normalised", "is_seed")}
        return replace(self, **columns)

    @property
    def outward(self) -> Floats:
        """Where the corners (V, 4, 2) go, in pixels, when all edges of their square go one pixel outward."""
        arm = (self.normalised - self.normalised.mean(axis=1, keepdims=True)) * self.focal_px
        return np.asarray(np.sqrt(2) * arm / np.linalg.norm(arm, axis=2, keepdims=True))  # along the diagonal

    def without_edge_shift(self, edge_px: float) -> SeenSquares:
        """The views as they were if edges had not been seen too far inside by this."""
        return replace(self, normalised=self.normalised + edge_px * self.outward / self.focal_px)


@dataclass(frozen=True, eq=False)
class CameraPoses:
    """P poses `scan_from_camera`: `centers` (P, 3) in metres and `rotations` (P, 3, 3)."""

    centers: Floats
    rotations: Floats

    def __len__(self) -> int:
        return len(self.centers)

    def moved(self, change: Floats) -> CameraPoses:
        """The poses shifted and turned (P, 6), metres and radians, both in the axes of the scan."""
        return CameraPoses(
            self.centers + change[:, :3], Rotation.from_rotvec(change[:, 3:]).as_matrix() @ self.rotations
        )

    def __getitem__(self, which: ArrayLike) -> CameraPoses:
        return CameraPoses(self.centers[which], self.rotations[which])  # type: ignore[index]


@dataclass(frozen=True, eq=False)
class Resection:
    """P poses, their `covariance` (P, 6, 6) of shift and turn in the axes of the scan, and how the V views agree.

    `chi2` (V,) is the squared error in units of its variance: about 8 less its share of the unknowns if all is well.
    """

    poses: CameraPoses
    covariance: Floats
    chi2: Floats


def errors_px(views: SeenSquares, poses: CameraPoses) -> Floats:
    """Reprojection errors (V, 4, 2); 10,000 px for corners that are not in front of the camera."""
    seen, is_ahead = _local(views, poses)
    off = (seen[..., :2] / seen[..., 2:] - views.normalised) * views.focal_px
    return np.asarray(np.where(is_ahead[..., None], off, _BEHIND_PX))


def distances_m(views: SeenSquares, poses: CameraPoses) -> Floats:
    """(V,) how far the views are from their squares, as RMS over the corners, at the squares' own distance."""
    squared = np.mean(np.sum((errors_px(views, poses) / views.focal_px) ** 2, axis=2), axis=1)
    return np.asarray(np.sqrt(squared) * _depth(views, poses))


def resect(views: SeenSquares, start: CameraPoses, errors: TagErrors) -> Resection:
    """The poses (P,) nearest to `start` that the views agree on."""
    poses = _descend(views, start, errors, _SCALES[0])
    several = np.bincount(views.pose, minlength=len(poses)) > 1  # a pose's only view is its seed, whatever the scale
    some, number = poses[several], np.cumsum(several) - 1
    shared = views.pick(several[views.pose])
    shared = replace(shared, pose=number[shared.pose])
    for times in _SCALES[1:]:
        some = _descend(shared, some, errors, times)
    agreeing = shared.pick(shared.is_seed | errors.agrees(chi2_of(shared, some, errors)))
    some = _descend(agreeing, some, errors, 1.0)  # the others still pulled a little
    poses.centers[several], poses.rotations[several] = some.centers, some.rotations
    normal, _ = normal_equations(views, poses, _weights(views, poses, errors), errors)
    covariance = np.asarray(np.linalg.inv(normal + 1e-9 * np.eye(6)), dtype=np.float64)
    return Resection(poses, covariance, chi2_of(views, poses, errors))


def chi2_of(views: SeenSquares, poses: CameraPoses, errors: TagErrors) -> Floats:
    """(V,) squared errors of the views in units of their variance."""
    return np.asarray(np.sum(whitened(errors_px(views, poses), views, poses, errors) ** 2, axis=(1, 2)))


def whitened(values: Floats, views: SeenSquares, poses: CameraPoses, errors: TagErrors) -> Floats:
    """Values (V, 4, ...) of the views' corners, in pixels, in units of their standard deviation."""
    place_px = views.focal_px.mean() * errors.place_error_m / _depth(views, poses)
    shared_px = np.sqrt(errors.corner_error_px**2 + 4 * place_px**2)  # twice that of the mean of the four
    mean = values.mean(axis=1, keepdims=True)
    own = (values - mean) / errors.corner_error_px
    return np.asarray(own + mean / shared_px.reshape(-1, *[1] * (values.ndim - 1)))


def normal_equations(
    views: SeenSquares, poses: CameraPoses, weight: Floats, errors: TagErrors
) -> tuple[Floats, Floats]:
    """The matrix (P, 6, 6) and the gradient (P, 6) for shifts and turns, of views with `weight` (V,)."""
    off = whitened(errors_px(views, poses), views, poses, errors).reshape(len(views), 8, 1)
    jacobian = whitened(pose_jacobian(views, poses), views, poses, errors).reshape(len(views), 8, 6)
    weighed = (weight[:, None, None] * jacobian).transpose(0, 2, 1)
    normal, gradient = np.zeros((len(poses), 6, 6)), np.zeros((len(poses), 6))
    np.add.at(normal, views.pose, weighed @ jacobian)
    np.add.at(gradient, views.pose, (weighed @ off)[..., 0])
    return normal, gradient


def _weights(views: SeenSquares, poses: CameraPoses, errors: TagErrors, times: float = 1.0) -> Floats:
    return np.where(views.is_seed, 1.0, errors.weight(chi2_of(views, poses, errors), times))


def _descend(views: SeenSquares, poses: CameraPoses, errors: TagErrors, times: float) -> CameraPoses:
    """The poses after some damped steps, each taken where it helps."""
    damping = np.full(len(poses), 1e-3)
    for _ in range(_ROUNDS):
        weight = _weights(views, poses, errors, times)
        normal, gradient = normal_equations(views, poses, weight, errors)
        diagonal = np.einsum("pii->pi", normal)
        damped = normal + (damping[:, None] * diagonal + 1e-9)[:, None, :] * np.eye(6)
        tried = poses.moved(-np.linalg.solve(damped, gradient[..., None])[..., 0])
        before, after = (
            np.bincount(views.pose, weight * chi2_of(views, p, errors), minlength=len(poses)) for p in (poses, tried)
        )
        better = after < before
        poses = CameraPoses(
            np.where(better[:, None], tried.centers, poses.centers),
            np.where(better[:, None, None], tried.rotations, poses.rotations),
        )
        damping = np.where(better, damping / 5, damping * 10)
    return poses


def pose_jacobian(views: SeenSquares, poses: CameraPoses) -> Floats:
    """How the errors (V, 4, 2) change with their pose's shift and turn in the axes of the scan: (V, 4, 2, 6).

    Zero for corners that are not in front of the camera.
    """
    seen, is_ahead = _local(views, poses)
    x, y, z = np.moveaxis(seen, -1, 0)
    zero = np.zeros_like(z)
    by_local = np.stack([np.stack([1 / z, zero, -x / z**2], -1), np.stack([zero, 1 / z, -y / z**2], -1)], axis=-2)
    by_local = by_local * views.focal_px[:, None] * is_ahead[..., None, None]
    by_place = by_local @ poses.rotations[views.pose].transpose(0, 2, 1)[:, None]
    arm = views.corners - poses.centers[views.pose][:, None]
    return np.concatenate([-by_place, np.cross(by_place, arm[..., None, :])], axis=3)


def _local(views: SeenSquares, poses: CameraPoses) -> tuple[Floats, Bools]:
    offset = views.corners - poses.centers[views.pose][:, None]
    seen = offset @ poses.rotations[views.pose]
    is_ahead = seen[..., 2] > _NEAREST_M
    return np.where(is_ahead[..., None], seen, 1.0), is_ahead


def _depth(views: SeenSquares, poses: CameraPoses) -> Floats:
    depth = _local(views, poses)[0][..., 2].mean(axis=1)
    return np.asarray(np.maximum(depth, _NEAREST_M), dtype=np.float64)
