"""The poses of all frames that see tags, adjusted together: tags, motion and what the light does to edges.

A frame with one small tag has a poor pose: its camera swings around the tag. Its neighbours know better, because a head
has inertia. So one least-squares problem holds, for every frame with a tag, its pose and its velocity, and

- its tags' corners, each tag robustly by itself, weighed as in `resection.py`;
- that velocity changes little between neighbours in time (white noise on acceleration: Barfoot, "State estimation for
  robotics", 2017, section 3.4), by the root of the time between them, so that a long gap ties nothing;
- one unknown shift of all edges: light bleeds over dark edges, so that a tag looks smaller than it is and thus further
  away (see `tags/bundle.py`).

A frame is tied to its neighbours, never made from them: it is here only because it sees a tag itself.

The matrix of the frames is block-tridiagonal, with the edge shift as a border that is eliminated last.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.spatial.transform import Rotation

from gazeloc_core.arrays import Bools, Floats
from gazeloc_core.localize.resection import (
    CameraPoses,
    SeenSquares,
    TagErrors,
    chi2_of,
    errors_px,
    normal_equations,
    pose_jacobian,
    whitened,
)

_MOST_ROUNDS = 12
_SETTLED_M = 1e-4
_SHORTEST_STEP_S = 1e-3
_STATE = 12


@dataclass(frozen=True, kw_only=True)
class SmootherOptions:
    """How heads move and what light does (standard deviations)."""

    velocity_change_m_per_s: float = 1.0
    """Change of the head's velocity over a second, per axis; it grows with the root of time."""
    spin_change_deg_per_s: float = 500.0
    """Change of its angular velocity over a second, per axis; it grows with the root of time."""
    speed_m_per_s: float = 1.0
    """Speed of the head, per axis."""
    spin_deg_per_s: float = 100.0
    """Angular speed of the head, per axis."""
    edge_shift_error_px: float = 0.5
    """How far tags may look too small or too large all round."""


@dataclass(frozen=True, eq=False)
class TagChain:
    """V views of tags in K frames at rising `seconds` (K,); `is_tied` (K - 1,) whether a frame and the next are one
    motion."""

    views: SeenSquares
    seconds: Floats
    is_tied: Bools


@dataclass(frozen=True, eq=False)
class Smoothed:
    """K adjusted poses; `chi2` (V,) squared errors of the views in units of their variance, edges shifted.

    `edge_shift_px` is how much smaller tags look than they are, all round.
    """

    poses: CameraPoses
    chi2: Floats
    edge_shift_px: float


@dataclass(frozen=True, eq=False)
class _State:
    poses: CameraPoses
    velocity: Floats  # (K, 6) metres and radians per second, in the axes of the scan
    edge_px: float


def smooth(chain: TagChain, start: CameraPoses, errors: TagErrors, options: SmootherOptions | None = None) -> Smoothed:
    """The poses of the chain's frames, from `start` (K,), by Gauss-Newton with damping where it overshoots."""
    problem = _Problem(chain, errors, options or SmootherOptions())
    state, damping = _State(start, np.zeros((len(start), 6)), 0.0), 1e-9
    cost = problem.cost(state)
    for _ in range(_MOST_ROUNDS):
        tried = problem.step(state, damping)
        tried_cost = problem.cost(tried)
        if tried_cost > cost:
            damping = max(damping, 1e-6) * 100
            continue
        moved = np.abs(tried.poses.centers - state.poses.centers).max(initial=0.0)
        state, cost, damping = tried, tried_cost, damping / 10
        if moved < _SETTLED_M:
            break
    return Smoothed(state.poses, chi2_of(problem.shifted(state.edge_px), state.poses, errors), state.edge_px)


class _Problem:
    """Cost and steps. A frame's unknowns: its shift and turn, and the changes of its two velocities."""

    def __init__(self, chain: TagChain, errors: TagErrors, options: SmootherOptions):
        self.chain, self.errors, self.options = chain, errors, options
        self.step_s = np.maximum(np.diff(chain.seconds), _SHORTEST_STEP_S)
        change = np.repeat([options.velocity_change_m_per_s, np.radians(options.spin_change_deg_per_s)], 3)
        self.motion_weight = _inverse_motion_covariance(self.step_s, change) * chain.is_tied[:, None, None]
        self.speed_weight = 1 / np.repeat([options.speed_m_per_s, np.radians(options.spin_deg_per_s)], 3) ** 2

    def shifted(self, edge_px: float) -> SeenSquares:
        """The views as they were without light on their edges."""
        return self.chain.views.without_edge_shift(edge_px)

    def _motion_errors(self, state: _State) -> Floats:
        """How far (K - 1, 12) a frame is from where the one before was heading, and its velocities from that one's."""
        poses = state.poses
        turn = poses.rotations[1:] @ poses.rotations[:-1].transpose(0, 2, 1)
        change = np.concatenate([np.diff(poses.centers, axis=0), Rotation.from_matrix(turn).as_rotvec()], axis=1)
        off = change - self.step_s[:, None] * state.velocity[:-1]
        return np.concatenate([off, np.diff(state.velocity, axis=0)], axis=1)

    def cost(self, state: _State) -> float:
        """The sum of all squared errors in units of their variances, those of views as Geman and McClure count them."""
        off = chi2_of(self.shifted(state.edge_px), state.poses, self.errors)
        limit = 8 * self.errors.outlier**2
        motion = self._motion_errors(state)
        return float(
            np.sum(limit * off / (limit + off))
            + np.einsum("ki,kij,kj->", motion, self.motion_weight, motion)
            + np.sum(state.velocity**2 * self.speed_weight)
            + (state.edge_px / self.options.edge_shift_error_px) ** 2
        )

    def step(self, state: _State, damping: float) -> _State:
        """The state after one step of Gauss-Newton."""
        diagonal, below, gradient = self._motion_terms(state)
        border, corner, slope = self._add_views(state, diagonal, gradient)
        diagonal += damping * np.einsum("kij,ij->kij", diagonal, np.eye(_STATE))
        factor = cholesky_banded(_banded(diagonal, below), lower=True, check_finite=False)
        both = np.column_stack([gradient.ravel(), border.ravel()])
        by_gradient, by_border = cho_solve_banded((factor, True), both, check_finite=False).T
        edge = -(slope - border.ravel() @ by_gradient) / (corner - border.ravel() @ by_border)
        change = -(by_gradient + by_border * edge).reshape(-1, _STATE)
        return _State(state.poses.moved(change[:, :6]), state.velocity + change[:, 6:], float(state.edge_px + edge))

    def _motion_terms(self, state: _State) -> tuple[Floats, Floats, Floats]:
        """What motion adds: diagonal blocks (K, 12, 12), those below it (K - 1, 12, 12) and the gradient (K, 12)."""
        count = len(state.poses)
        error, weight = self._motion_errors(state), self.motion_weight
        by_before = np.tile(-np.eye(_STATE), (count - 1, 1, 1))
        by_before[:, :6, 6:] = -self.step_s[:, None, None] * np.eye(6)
        by_before_t = by_before.transpose(0, 2, 1)
        diagonal, gradient = np.zeros((count, _STATE, _STATE)), np.zeros((count, _STATE))
        diagonal[:-1] += by_before_t @ weight @ by_before
        diagonal[1:] += weight
        gradient[:-1] += np.einsum("kij,kjl,kl->ki", by_before_t, weight, error)
        gradient[1:] += np.einsum("kij,kj->ki", weight, error)
        diagonal[:, range(6, 12), range(6, 12)] += self.speed_weight
        gradient[:, 6:] += self.speed_weight * state.velocity
        return diagonal, weight @ by_before, gradient

    def _add_views(self, state: _State, diagonal: Floats, gradient: Floats) -> tuple[Floats, float, float]:
        """Add what the views say of the frames; the border (K, 12) of the edge shift, its corner and its slope."""
        views, poses, errors = self.shifted(state.edge_px), state.poses, self.errors
        error = whitened(errors_px(views, poses), views, poses, errors).reshape(-1, 8)
        weight = errors.weight(np.sum(error**2, axis=1))
        normal, slope = normal_equations(views, poses, weight, errors)
        diagonal[:, :6, :6] += normal
        gradient[:, :6] += slope
        by_pose = whitened(pose_jacobian(views, poses), views, poses, errors).reshape(-1, 8, 6)
        by_edge = weight[:, None] * whitened(-self.chain.views.outward, views, poses, errors).reshape(-1, 8)
        border = np.zeros((len(diagonal), _STATE))
        np.add.at(border[:, :6], views.pose, np.einsum("vri,vr->vi", by_pose, by_edge))
        prior = self.options.edge_shift_error_px**-2
        corner = np.sum(by_edge**2 / weight[:, None]) + prior
        return border, float(corner), float(np.sum(by_edge * error) + prior * state.edge_px)


def _inverse_motion_covariance(step_s: Floats, change: Floats) -> Floats:
    """The inverse covariance (L, 12, 12) of what white noise on acceleration does to place and velocity over a step.

    Barfoot 2017, equation 3.197: with density q, [[t³/3, t²/2], [t²/2, t]] q.
    """
    t = step_s[:, None, None]
    inverse = np.block([[12 / t**3, -6 / t**2], [-6 / t**2, 4 / t]])
    return np.asarray(np.einsum("kij,ab->kiajb", inverse, np.diag(1 / change**2)).reshape(-1, _STATE, _STATE))


def _banded(diagonal: Floats, below: Floats) -> Floats:
    """The lower band (24, 12 K) of a block-tridiagonal matrix, as SciPy stores it."""
    band = np.zeros((2 * _STATE, len(diagonal) * _STATE))
    for row in range(_STATE):
        for column in range(_STATE):
            if row >= column:
                band[row - column, column::_STATE] = diagonal[:, row, column]
            band[_STATE + row - column, column : len(below) * _STATE : _STATE] = below[:, row, column]
    return band
