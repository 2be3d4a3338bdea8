"""Points from their sightings in posed cameras, robustly, many points at once.

Start: of the middles between two rays the one that most sightings agree with (MSAC over pairs: Torr and Zisserman,
"MLESAC", CVIU 2000). Then Gauss-Newton on the reprojection error with Huber weights. Then sightings that disagree are
dropped and it is done once more. What two or more rays do not determine is NaN, never a guess.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import RigidTransform

from gazeloc_core.arrays import Bools, Floats, Ints, frozen
from gazeloc_core.camera import Camera
from gazeloc_core.errors import GeometryError

_MOST_PAIRS = 100
_LEAST_SINE2 = 1e-6
_SINGULAR = 1e-18
_NEWTON_ROUNDS = 12
_OUTLIER_ROUNDS = 3


@dataclass(frozen=True, kw_only=True)
class TriangulationOptions:
    """When sightings agree, and when a point is reliable."""

    huber_px: float = 1.0
    """Reprojection errors beyond this count linearly instead of squared."""
    outlier_px: float = 4.0
    """Sightings that are off by more than this are dropped; up to three times as much where most are off."""
    min_parallax_deg: float = 1.0
    """Least angle between two rays of a reliable point."""
    max_rms_px: float = 5.0
    """Largest remaining error of a reliable point."""
    click_px: float = 1.5
    """By how much a person's click in a frame is off, per axis."""


@dataclass(frozen=True, eq=False)
class Observations:
    """O sightings of points: `point` (O,) is the number of the point from 0.

    `camera_from_world` (O, 3, 4); `normalised` (O, 2) is the ray's x/z and y/z in the camera; `focal_px` (O,).
    """

    point: Ints
    camera_from_world: Floats
    normalised: Floats
    focal_px: Floats

    @classmethod
    def of(
        cls, point: ArrayLike, cameras: Sequence[Camera], world_from_camera: RigidTransform, pixels: ArrayLike
    ) -> Observations:
        """Sightings at `pixels` (O, 2) in `cameras` (O,) at poses `world_from_camera` (O,).

        Raises:
            GeometryError: if a pixel has no ray in its camera.
        """
        px = np.asarray(pixels, dtype=np.float64).reshape(-1, 2)
        rays = np.empty((len(px), 3))
        for camera in {id(c): c for c in cameras}.values():  # one call per camera, there is mostly one
            mine = np.array([c is camera for c in cameras])
            rays[mine] = camera.unproject(px[mine])
        if not np.isfinite(rays).all():
            bad = px[~np.isfinite(rays).all(axis=1)][0]
            raise GeometryError(f"The camera has no ray for the pixel {bad.round(1).tolist()}; check its calibration.")
        focal = np.array([float(c.focal_px.mean()) for c in cameras])
        matrices = world_from_camera.inv().as_matrix().reshape(-1, 4, 4)[:, :3]
        return cls(frozen(point, np.int64), frozen(matrices), frozen(rays[:, :2] / rays[:, 2:]), frozen(focal))

    def __len__(self) -> int:
        return len(self.point)

    def pick(self, which: Bools | Ints) -> Observations:
        """Only some of the sightings."""
        return Observations(
            self.point[which], self.camera_from_world[which], self.normalised[which], self.focal_px[which]
        )

    @property
    def centers(self) -> Floats:
        """Camera centres (O, 3) in the world."""
        rotation, offset = self.camera_from_world[:, :, :3], self.camera_from_world[:, :, 3]
        return np.asarray(-np.einsum("oji,oj->oi", rotation, offset))

    @property
    def rays(self) -> Floats:
        """Unit rays (O, 3) in the world."""
        local = np.column_stack([self.normalised, np.ones(len(self))])
        local /= np.linalg.norm(local, axis=1, keepdims=True)
        return np.asarray(np.einsum("oji,oj->oi", self.camera_from_world[:, :, :3], local))

    def in_camera(self, points: Floats) -> Floats:
        """Each sighting's point (O, 3) in its camera, of `points` (P, 3) in the world."""
        rotation, offset = self.camera_from_world[:, :, :3], self.camera_from_world[:, :, 3]
        return np.asarray(np.einsum("oij,oj->oi", rotation, points[self.point]) + offset)

    def errors_px(self, points: Floats) -> Floats:
        """Reprojection errors (O, 2) in pixels, inf for a point that is not in front of its camera."""
        local = self.in_camera(points)
        ahead = local[:, 2] > 0  # False for NaN
        errors = np.full((len(self), 2), np.inf)
        errors[ahead] = (local[ahead, :2] / local[ahead, 2:] - self.normalised[ahead]) * self.focal_px[ahead, None]
        return errors


@dataclass(frozen=True, eq=False)
class TriangulatedPoints:
    """P points in the world: `points` (P, 3) with `covariance` (P, 3, 3), NaN where they are not determined.

    `rms_px` (P,) is the error per sighting, `parallax_deg` (P,) the largest angle between two rays, `views` (P,) the
    sightings used, `is_used` (O,) which these are, `is_reliable` (P,) whether the options' bounds are met.
    """

    points: Floats
    covariance: Floats
    rms_px: Floats
    parallax_deg: Floats
    views: Ints
    is_used: Bools
    is_reliable: Bools


@dataclass(frozen=True, eq=False)
class TriangulatedPoint:
    """One point (3,) from clicks: its error per click, the largest angle between two rays, and whether to trust it.

    `sigma` is its standard deviation (root mean square over the axes, in the frame's units) if clicks are off by
    `click_px` or by as much as they disagree.
    """

    point: Floats
    sigma: float
    rms_px: float
    parallax_deg: float
    is_reliable: bool


def triangulate(
    observations: Observations, count: int, options: TriangulationOptions | None = None
) -> TriangulatedPoints:
    """The points 0 to `count` - 1 from their sightings; a point with too few or parallel rays is NaN."""
    options = options or TriangulationOptions()
    points = _best_of_pairs(observations, count, options)
    used = _agreeing(observations, points, np.ones(len(observations), dtype=np.bool_), options)
    for _ in range(_OUTLIER_ROUNDS):
        points = _gauss_newton(observations.pick(used), points, options)
        before, used = used, _agreeing(observations, points, used, options)
        if (before == used).all():
            break
    return _judged(observations, points, used, count, options)


def triangulate_sightings(
    cameras: Sequence[Camera],
    frame_from_camera: RigidTransform,
    pixels: ArrayLike,
    options: TriangulationOptions | None = None,
) -> TriangulatedPoint:
    """The one point that was seen at `pixels` (K, 2) by `cameras` (K,) at poses (K,), in the frame of the poses.

    Every click counts: none is dropped as an outlier, their disagreement is in `rms_px` and `is_reliable`.

    Raises:
        GeometryError: if there are fewer than two, their rays are closer to parallel than the least parallax, or they
            meet behind a camera.
    """
    options = options or TriangulationOptions()
    px = np.asarray(pixels, dtype=np.float64).reshape(-1, 2)
    if len(px) < 2:
        raise GeometryError(f"A point needs clicks in at least two frames, got {len(px)}; click it in another frame.")
    seen = Observations.of(np.zeros(len(px)), cameras, frame_from_camera, px)
    parallax = _parallax_deg(seen, 1)[0]
    if parallax < options.min_parallax_deg:
        raise GeometryError(
            f"The frames see the point from nearly the same side ({parallax:.2f}° apart, {options.min_parallax_deg:g}° "
            "is the least); click it in a frame further away."
        )
    point = _gauss_newton(seen, _best_of_pairs(seen, 1, options), options)
    errors = np.linalg.norm(seen.errors_px(point), axis=1)
    if not np.isfinite(errors).all():
        raise GeometryError("The clicks meet behind a camera; they do not show the same place, click it again.")
    rms = float(np.sqrt(np.mean(errors**2)))
    covariance = np.linalg.pinv(_normal_equations(seen, point, options)[0][0], hermitian=True)
    sigma = max(options.click_px, rms) * float(np.sqrt(np.trace(covariance) / 3))
    return TriangulatedPoint(frozen(point[0]), sigma, rms, float(parallax), rms <= options.max_rms_px)


def _sum_by_point(values: Floats, point: Ints, count: int) -> Floats:
    total = np.zeros((count, *values.shape[1:]))
    np.add.at(total, point, values)
    return total


def _groups(point: Ints) -> list[tuple[int, Ints]]:
    """For each point that occurs its number and the positions of its sightings."""
    order = np.argsort(point, kind="stable")
    ids, starts = np.unique(point[order], return_index=True)
    return [(int(i), order[a:b]) for i, a, b in zip(ids, starts, np.append(starts, len(order))[1:], strict=True)]


def _solve(matrices: Floats, vectors: Floats) -> Floats:
    """Batch of 3x3 systems (P, 3, 3) and (P, 3); NaN where the matrix is singular."""
    size = np.maximum(np.trace(matrices, axis1=1, axis2=2) / 3, 1e-300)
    determined = np.linalg.det(matrices / size[:, None, None]) > _SINGULAR
    answer = np.full(vectors.shape, np.nan)
    answer[determined] = np.linalg.solve(matrices[determined], vectors[determined][..., None])[..., 0]
    return answer


def _best_of_pairs(seen: Observations, count: int, options: TriangulationOptions) -> Floats:
    """The points (P, 3) between two rays that most sightings agree with; NaN where all rays are parallel."""
    points = np.full((count, 3), np.nan)
    rays, centers = seen.rays, seen.centers
    rng = np.random.default_rng(0)
    for point, mine in _groups(seen.point):
        first, second = np.triu_indices(len(mine), 1)
        if len(first) > _MOST_PAIRS:
            some = rng.permutation(len(first))[:_MOST_PAIRS]
            first, second = first[some], second[some]
        candidates = _between(centers[mine[first]], rays[mine[first]], centers[mine[second]], rays[mine[second]])
        candidates = candidates[np.isfinite(candidates).all(axis=1)]
        if len(candidates) == 0:
            continue
        here = seen.pick(mine)
        local = np.einsum("oij,cj->coi", here.camera_from_world[:, :, :3], candidates) + here.camera_from_world[:, :, 3]
        z = np.where(local[..., 2] > 0, local[..., 2], np.nan)[..., None]
        off = np.linalg.norm(local[..., :2] / z - here.normalised, axis=2) * here.focal_px
        loss = np.minimum(np.nan_to_num(off, nan=np.inf) / options.outlier_px, 1.0) ** 2  # MSAC
        points[point] = candidates[loss.sum(axis=1).argmin()]
    return points


def _between(center_a: Floats, ray_a: Floats, center_b: Floats, ray_b: Floats) -> Floats:
    """The middles (C, 3) of the shortest lines between two rays each; NaN for rays within 0.06° of parallel."""
    offset, cosine = center_b - center_a, np.sum(ray_a * ray_b, axis=1)
    sine2 = np.maximum(1 - cosine**2, 0)
    a, b = np.sum(ray_a * offset, axis=1), np.sum(ray_b * offset, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        along_a, along_b = (a - b * cosine) / sine2, (a * cosine - b) / sine2
        middle = (center_a + along_a[:, None] * ray_a + center_b + along_b[:, None] * ray_b) / 2
    middle[sine2 < _LEAST_SINE2] = np.nan
    return np.asarray(middle)


def _gauss_newton(seen: Observations, start: Floats, options: TriangulationOptions) -> Floats:
    """`start` (P, 3) moved to the least Huber reprojection error; steps that do not lessen it are not taken."""
    points = start.copy()
    cost = _cost(seen, points, options)
    for _ in range(_NEWTON_ROUNDS):
        normal, gradient = _normal_equations(seen, points, options)
        step = np.nan_to_num(_solve(normal, gradient))
        moved = points - step
        new_cost = _cost(seen, moved, options)
        better = new_cost < cost
        points[better], cost[better] = moved[better], new_cost[better]
        if not better.any():
            break
    return points


def _cost(seen: Observations, points: Floats, options: TriangulationOptions) -> Floats:
    size = np.linalg.norm(seen.errors_px(points), axis=1)
    huber = np.where(size <= options.huber_px, size**2, 2 * options.huber_px * size - options.huber_px**2)
    return _sum_by_point(huber, seen.point, len(points))


def _normal_equations(seen: Observations, points: Floats, options: TriangulationOptions) -> tuple[Floats, Floats]:
    """JᵀWJ (P, 3, 3) and JᵀWr (P, 3) of the reprojection errors; sightings from behind do not count."""
    local = seen.in_camera(points)
    errors = seen.errors_px(points)
    size = np.linalg.norm(errors, axis=1)
    counts = np.isfinite(size)
    z = np.where(counts, local[:, 2], 1.0)
    projection = np.zeros((len(seen), 2, 3))
    projection[:, 0, 0] = projection[:, 1, 1] = 1 / z
    projection[:, :, 2] = -local[:, :2] / (z**2)[:, None]
    jacobian = seen.focal_px[:, None, None] * projection @ seen.camera_from_world[:, :, :3]
    weight = np.minimum(1.0, options.huber_px / np.maximum(size, 1e-12))
    jacobian, errors, weight = jacobian[counts], errors[counts], weight[counts]
    weighted = weight[:, None, None] * jacobian
    normal = _sum_by_point(np.einsum("oki,okj->oij", weighted, jacobian), seen.point[counts], len(points))
    gradient = _sum_by_point(np.einsum("oki,ok->oi", weighted, errors), seen.point[counts], len(points))
    return normal, gradient


def _agreeing(observations: Observations, points: Floats, used: Bools, options: TriangulationOptions) -> Bools:
    """(O,) the sightings that agree with their point."""
    size = np.linalg.norm(observations.errors_px(points), axis=1)
    bound = np.full(len(points), options.outlier_px)
    for point, mine in _groups(observations.point):
        median = np.median(size[mine][used[mine]]) if used[mine].any() else np.inf
        if np.isfinite(median):
            bound[point] = options.outlier_px * float(np.clip(4 * median / options.outlier_px, 1, 3))
    return np.asarray(size <= bound[observations.point])


def _judged(
    observations: Observations, points: Floats, used: Bools, count: int, options: TriangulationOptions
) -> TriangulatedPoints:
    some = observations.pick(used)
    views = np.bincount(some.point, minlength=count).astype(np.int64)
    square = np.sum(some.errors_px(points) ** 2, axis=1)
    rms = np.sqrt(_sum_by_point(square, some.point, count) / np.maximum(views, 1))
    parallax = _parallax_deg(some, count)
    determined = (views >= 2) & np.isfinite(points).all(axis=1) & np.isfinite(rms) & (parallax > 1e-3)
    reliable = determined & (parallax >= options.min_parallax_deg) & (rms <= options.max_rms_px)
    normal, _ = _normal_equations(some, points, replace(options, huber_px=np.inf))
    covariance = np.full((count, 3, 3), np.nan)
    sigma = np.maximum(rms, 0.1)  # no detector is better than a tenth of a pixel
    covariance[determined] = np.linalg.inv(normal[determined]) * (sigma[determined] ** 2)[:, None, None]
    points = np.where(determined[:, None], points, np.nan)
    rms = np.where(determined, rms, np.nan)
    return TriangulatedPoints(points, covariance, rms, parallax, views, used, reliable)


def _parallax_deg(seen: Observations, count: int) -> Floats:
    """(P,) the largest angle between two rays of each point, 0 for fewer than two."""
    rays = seen.rays
    parallax = np.zeros(count)
    for point, mine in _groups(seen.point):
        sine = np.linalg.norm(np.cross(rays[mine][:, None], rays[mine][None]), axis=2)
        cosine = rays[mine] @ rays[mine].T
        parallax[point] = np.degrees(np.arctan2(sine, cosine).max())
    return parallax
