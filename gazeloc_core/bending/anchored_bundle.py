"""Bundle adjustment of a reconstruction with points whose places are known to some precision: soft control points.

As in aerial photogrammetry (Triggs et al. 2000, "Bundle adjustment: a modern synthesis"), control points join the
adjustment as observations with an error of their own: they must be seen where they are seen, and lie where they are
known to lie. Gauss-Newton on all camera poses and points with Marquardt's damping, the points eliminated (Schur
complement), Cauchy's robust weights. Intrinsics stay.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse import bsr_array
from scipy.spatial.transform import RigidTransform, Rotation

from gazeloc_core.arrays import Bools, Floats, Ints, frozen
from gazeloc_core.progress import Report, silent
from gazeloc_core.sfm_model import SfmModel

_MOST_STEPS = 25
_SMALLEST_GAIN = 1e-6
_SMALLEST_DAMPING, _FIRST_DAMPING, _LARGEST_DAMPING = 1e-9, 1e-4, 1e6


@dataclass(frozen=True, kw_only=True)
class AnchorOptions:
    """How observations and places are weighed, and how much takes part."""

    pixel_error_px: float = 1.0
    """Errors of observations beyond this count ever less."""
    least_views: int = 3
    """Points that fewer images show do not take part."""
    most_observations: int = 80_000
    """With more, points of the longest tracks take part: a second per step is enough."""


@dataclass(frozen=True, eq=False)
class Anchors:
    """C points whose places are known: `points` (C, 3) and standard deviations `sigma` (C,), both in sfm units.

    An infinite `sigma` says nothing about a place. `group` (C,) numbers what is right or wrong together, as the corners
    of a tag. They are seen in O observations: `point` (O,) numbers the points, `image` (O,) the model's images, `px`
    (O, 2).
    """

    points: Floats
    sigma: Floats
    group: Ints
    point: Ints
    image: Ints
    px: Floats

    def __post_init__(self) -> None:
        for name in ("points", "sigma", "px"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        for name in ("group", "point", "image"):
            object.__setattr__(self, name, frozen(getattr(self, name), np.int64))


@dataclass(frozen=True, eq=False)
class Anchored:
    """The adjusted model, where the anchors came to lie (`points`, (C, 3)), and the robust cost before and after."""

    model: SfmModel
    points: Floats
    cost_before: float
    cost_after: float


def anchor(
    model: SfmModel, anchors: Anchors, options: AnchorOptions | None = None, report: Report = silent
) -> Anchored:
    """The model with its cameras (pinhole ones) and points adjusted to the anchors.

    Points that did not take part go along with the cameras that see them.

    Raises:
        Cancelled: when `report` raises it, which is called before every step.
    """
    options = options or AnchorOptions()
    problem = _Problem(model, anchors, options)
    state = problem.start()
    cost = before = problem.cost(state)
    damping = _FIRST_DAMPING
    for _ in range(_MOST_STEPS):
        report(0.5, "bending the reconstruction")
        equations = problem.linearised(state)
        tried, new = state, float("inf")
        while new >= cost and damping < _LARGEST_DAMPING:
            try:
                tried = problem.moved(state, equations, damping)
                new = problem.cost(tried)
            except np.linalg.LinAlgError:  # not positive definite with so little damping
                new = float("inf")
            damping *= 10
        if new >= cost:
            break
        gain, state, cost = (cost - new) / cost, tried, new
        damping = max(damping / 100, _SMALLEST_DAMPING)
        if gain < _SMALLEST_GAIN:
            break
    return Anchored(problem.model_of(state), state.points[problem.first_anchor :], before, cost)


@dataclass(frozen=True, eq=False)
class _State:
    """`rotation` (K, 3, 3) and `translation` (K, 3) of `camera_from_sfm`, `points` (P, 3)."""

    rotation: Floats
    translation: Floats
    points: Floats


@dataclass(frozen=True, eq=False)
class _Equations:
    """Normal equations: blocks of cameras `u` (K, 6, 6), of points `v` (P, 3, 3), of both `w`, and right-hand sides."""

    u: Floats
    v: Floats
    w: bsr_array
    b_camera: Floats
    b_point: Floats


class _Problem:
    """The observations and anchors as columns, and what a step needs of them."""

    def __init__(self, model: SfmModel, anchors: Anchors, options: AnchorOptions):
        self._model, self._anchors, self._options = model, anchors, options
        is_strong = _strong(model, options)
        number = np.cumsum(is_strong) - 1
        kept = is_strong[model.observation_point]
        self._strong = np.flatnonzero(is_strong)
        self.first_anchor = len(self._strong)
        self._camera = np.concatenate([model.observation_image[kept], anchors.image])
        self._point = np.concatenate([number[model.observation_point[kept]], self.first_anchor + anchors.point])
        px = np.concatenate([model.observation_px[kept], anchors.px])
        is_before = self._in_camera(self.start())[:, 2] > 0  # a camera that turned away, or a wrong match
        self._camera, self._point, self._px = self._camera[is_before], self._point[is_before], px[is_before]
        self._freedoms = 3 * np.bincount(anchors.group)
        cameras = [model.camera_of(i) for i in range(len(model))]
        self._focal = np.array([camera.focal_px for camera in cameras])[self._camera]
        self._centre = np.array([camera.principal_point_px for camera in cameras])[self._camera]

    def start(self) -> _State:
        """The model as it is; anchors start at their places."""
        camera_from_sfm = self._model.sfm_from_camera.inv()
        points = np.concatenate([self._model.points[self._strong], self._anchors.points])
        return _State(camera_from_sfm.rotation.as_matrix(), np.array(camera_from_sfm.translation), points)

    def cost(self, state: _State) -> float:
        """The robust cost; infinite where a point got behind a camera that sees it."""
        in_camera = self._in_camera(state)
        if (in_camera[:, 2] <= 0).any():
            return float("inf")
        scale = self._options.pixel_error_px
        squares = np.sum(((self._projected(in_camera) - self._px) / scale) ** 2, axis=1)
        return float(np.log1p(squares).sum() + (self._freedoms * np.log1p(self._place_squares(state))).sum())

    def linearised(self, state: _State) -> _Equations:
        """The normal equations at a state, with the weights of Cauchy's loss."""
        in_camera = self._in_camera(state)
        scale = self._options.pixel_error_px
        residual = (self._projected(in_camera) - self._px) / scale
        weight = 1 / (1 + np.sum(residual**2, axis=1))
        x, y, z = in_camera.T
        by_camera = np.zeros((len(z), 2, 3))
        by_camera[:, 0, 0], by_camera[:, 1, 1] = (self._focal / z[:, None]).T / scale
        by_camera[:, 0, 2], by_camera[:, 1, 2] = -(self._focal * np.stack([x, y], 1) / z[:, None] ** 2).T / scale
        by_point = by_camera @ state.rotation[self._camera]
        by_pose = np.concatenate([-by_camera @ _crosses(in_camera), by_camera], axis=2)
        weighted = weight[:, None, None] * by_pose
        k, p = len(state.rotation), len(state.points)
        u = _summed(np.einsum("oij,oil->ojl", weighted, by_pose), self._camera, k)
        b_camera = -_summed(np.einsum("oij,oi->oj", weighted, residual), self._camera, k)
        v = _summed(np.einsum("oij,oil,o->ojl", by_point, by_point, weight), self._point, p)
        b_point = -_summed(np.einsum("oij,oi,o->oj", by_point, residual, weight), self._point, p)
        place = 1 / (1 + self._place_squares(state))[self._anchors.group] / self._anchors.sigma**2
        v[self.first_anchor :] += place[:, None, None] * np.eye(3)
        b_point[self.first_anchor :] -= place[:, None] * (state.points[self.first_anchor :] - self._anchors.points)
        w = _block_matrix(np.einsum("oij,oil->ojl", weighted, by_point), self._camera, self._point, k, p)
        return _Equations(u, v, w, b_camera, b_point)

    def moved(self, state: _State, equations: _Equations, damping: float) -> _State:
        """The state after a damped step: points eliminated, cameras solved, points put back."""
        u, v = _damped(equations.u, damping), _damped(equations.v, damping)
        k, p = len(u), len(v)
        inverse = bsr_array((np.linalg.inv(v), np.arange(p), np.arange(p + 1)), shape=(3 * p, 3 * p))
        through = equations.w @ inverse
        reduced = -np.asarray((through @ equations.w.T).todense())
        rows = 6 * np.arange(k)[:, None] + np.arange(6)
        reduced[rows[:, :, None], rows[:, None, :]] += u
        right = equations.b_camera.ravel() - through @ equations.b_point.ravel()
        step = cho_solve(cho_factor(reduced), right)
        point_step = inverse @ (equations.b_point.ravel() - equations.w.T @ step)
        turn = Rotation.from_rotvec(step.reshape(k, 6)[:, :3]).as_matrix()
        translation = np.einsum("kij,kj->ki", turn, state.translation) + step.reshape(k, 6)[:, 3:]
        return _State(turn @ state.rotation, translation, state.points + point_step.reshape(p, 3))

    def model_of(self, state: _State) -> SfmModel:
        """The model at a state; points that did not take part move with the cameras that see them."""
        pose = RigidTransform.from_components(state.translation, Rotation.from_matrix(state.rotation)).inv()
        model = self._model
        moved = (pose * model.sfm_from_camera.inv())[model.observation_image].apply(
            model.points[model.observation_point]
        )
        views = np.maximum(np.bincount(model.observation_point, minlength=len(model.points)), 1)
        points = _summed(moved, model.observation_point, len(model.points)) / views[:, None]
        points[self._strong] = state.points[: self.first_anchor]
        return replace(model, sfm_from_camera=pose, points=points)

    def _in_camera(self, state: _State) -> Floats:
        turned = np.einsum("oij,oj->oi", state.rotation[self._camera], state.points[self._point])
        return np.asarray(turned + state.translation[self._camera])

    def _projected(self, in_camera: Floats) -> Floats:
        return np.asarray(self._focal * in_camera[:, :2] / in_camera[:, 2:] + self._centre)

    def _place_squares(self, state: _State) -> Floats:
        """(G,) mean squares, per coordinate, of how far the groups' points are off, in standard deviations."""
        off = (state.points[self.first_anchor :] - self._anchors.points) / self._anchors.sigma[:, None]
        return np.asarray(np.bincount(self._anchors.group, np.sum(off**2, axis=1)) / self._freedoms, dtype=np.float64)


def _strong(model: SfmModel, options: AnchorOptions) -> Bools:
    """(P,) which points take part."""
    is_strong = model.track_lengths >= options.least_views
    order = np.argsort(-model.track_lengths, kind="stable")
    is_first = np.zeros(len(order), dtype=np.bool_)
    is_first[order] = np.cumsum(model.track_lengths[order]) <= options.most_observations
    return np.asarray(is_strong & is_first)


def _crosses(vectors: Floats) -> Floats:
    """Matrices (O, 3, 3) of the cross products with vectors (O, 3)."""
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)


def _summed(values: Floats, index: Ints, count: int) -> Floats:
    """Sums (count, ...) of the values (O, ...) that share an index."""
    flat = values.reshape(len(values), -1)
    columns = [np.bincount(index, column, count) for column in flat.T]
    return np.asarray(np.stack(columns, axis=1).reshape(count, *values.shape[1:]), dtype=np.float64)


def _damped(blocks: Floats, damping: float) -> Floats:
    """Blocks with their diagonals raised by a share of themselves (Marquardt's scaling)."""
    diagonal = np.einsum("kii->ki", blocks)
    return np.asarray(blocks + damping * np.maximum(diagonal, 1e-12)[:, :, None] * np.eye(blocks.shape[1]))


def _block_matrix(blocks: Floats, row: Ints, column: Ints, rows: int, columns: int) -> bsr_array:
    """The block matrix of blocks (O, 6, 3); those at one place are added up."""
    order = np.lexsort((column, row))
    starts = np.searchsorted(row[order], np.arange(rows + 1))
    matrix = bsr_array((blocks[order], column[order], starts), shape=(6 * rows, 3 * columns))
    matrix.sum_duplicates()
    return matrix
