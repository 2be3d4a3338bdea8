"""Which of its candidates each frame takes, by what its neighbours in time say (Viterbi), and what is left open.

A head moves little between two frames, while the wrong one of a tag's two poses lies far from the right one; so the
cheapest path through the candidates tells them apart where the pictures alone do not. A path may leave a frame out, at
a price: that frame then contradicts all others. It may jump, at a higher price.

Every candidate's `gap` is how much dearer the cheapest path through it is (its min-marginal): 0 on the best path. A
frame whose second candidate has a small gap and lies somewhere else is ambiguous.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from gazeloc_core.arrays import Bools, Floats, Ints
from gazeloc_core.localize.tag_candidates import Candidates

NO_CANDIDATE = -1
_LOOK_BACK = 5
_SHORTEST_STEP_S = 1e-3
_SAME_COST = 1e-6


@dataclass(frozen=True, kw_only=True)
class PathOptions:
    """How a head moves, and what may go wrong; costs are minus log-likelihoods."""

    speed_m_per_s: float = 1.0
    """Speed of the head (standard deviation per axis)."""
    spin_deg_per_s: float = 100.0
    """Its angular speed (standard deviation per axis)."""
    skip_cost: float = 2.0
    """What leaving out a frame costs, beyond what its tags would have taken off."""
    jump_cost: float = 18.0
    """The most that two neighbours which do not fit may cost."""
    sure_gap: float = 4.0
    """A frame's candidate is sure if every other one is dearer by this: 4 is 50 to 1."""
    apart_m: float = 0.15
    """Candidates nearer to each other than this, and than the angle below, leave no doubt worth a rejection."""
    apart_deg: float = 5.0
    """The angle for it."""


@dataclass(frozen=True, eq=False)
class Chosen:
    """Of K frames (`frame` (K,) rising): `candidate` (K,), -1 where left out; `is_open` (K,) two places possible."""

    frame: Ints
    candidate: Ints
    is_open: Bools


def are_tied(path: Candidates, seconds: Floats, options: PathOptions) -> Bools:
    """(K - 1,) whether each of K candidates, one per frame, and the next are one motion, not a jump."""
    rows = np.arange(len(path))
    return np.asarray(_motion_costs(path, seconds[path.frame], rows[:-1], rows[1:], options) < options.jump_cost)


def choose_path(candidates: Candidates, seconds: Floats, options: PathOptions) -> Chosen:
    """The choice for every frame that has candidates; `seconds` (N,) are the times of all frames of the recording."""
    frame, first = np.unique(candidates.frame, return_index=True)
    bounds = [*first.tolist(), len(candidates)]
    gap = _gaps(candidates, seconds, bounds, options) if len(candidates) else np.empty(0)
    chosen = np.full(len(frame), NO_CANDIDATE)
    is_open = np.zeros(len(frame), dtype=np.bool_)
    for k, (a, b) in enumerate(itertools.pairwise(bounds)):
        best = a + int(gap[a:b].argmin())
        if gap[best] <= _SAME_COST:
            chosen[k] = best
            rivals = a + np.flatnonzero(gap[a:b] < options.sure_gap)
            is_open[k] = any(_are_apart(candidates, best, int(other), options) for other in rivals)
    return Chosen(frame, chosen, is_open)


def _gaps(candidates: Candidates, seconds: Floats, bounds: list[int], options: PathOptions) -> Floats:
    """(C,) how much dearer than the best path the cheapest path through each candidate is."""
    times = seconds[candidates.frame]
    links = [_links(candidates, times, bounds, back, options) for back in range(1, _LOOK_BACK + 1)]
    forward = _costs(candidates.cost, bounds, links, options)
    mirrored = [len(candidates) - edge for edge in reversed(bounds)]
    turned = [[link.T[::-1, ::-1] for link in reversed(of_step)] for of_step in links]
    backward = _costs(candidates.cost[::-1], mirrored, turned, options)[::-1]
    through = forward + backward - candidates.cost
    # A path takes at least one frame; leaving out all of them is no answer but a question of the caller's.
    return np.asarray(through - through.min())


def _costs(cost: Floats, bounds: list[int], links: list[list[Floats]], options: PathOptions) -> Floats:
    """(C,) the cheapest path that ends in each candidate, frames left out before and between included.

    `links[s][k]` (c, d) is what it costs to go from the candidates of frame k to those of frame k + s + 1.
    """
    reached = np.empty(len(cost))
    anywhere = np.inf  # the cheapest end of a path so far, with all frames after it left out
    for k, (a, b) in enumerate(itertools.pairwise(bounds)):
        best = np.full(b - a, min(k * options.skip_cost, anywhere + options.jump_cost))
        for back in range(1, min(_LOOK_BACK, k) + 1):
            before = reached[bounds[k - back] : bounds[k - back + 1]] + (back - 1) * options.skip_cost
            best = np.minimum(best, (before[:, None] + links[back - 1][k - back]).min(axis=0))
        reached[a:b] = best + cost[a:b]
        anywhere = min(anywhere + options.skip_cost, reached[a:b].min())
    return reached


def _links(candidates: Candidates, times: Floats, bounds: list[int], back: int, options: PathOptions) -> list[Floats]:
    """What it costs to go from the candidates of each frame to those of the one `back` later (in frames with any)."""
    count = np.diff(bounds)
    shapes = list(zip(count[:-back].tolist(), count[back:].tolist(), strict=True)) if len(count) > back else []
    if not shapes:
        return []
    pairs = [np.indices(shape).reshape(2, -1) for shape in shapes]
    source = np.concatenate([pair[0] + bounds[k] for k, pair in enumerate(pairs)])
    target = np.concatenate([pair[1] + bounds[k + back] for k, pair in enumerate(pairs)])
    costs = np.minimum(_motion_costs(candidates, times, source, target, options), options.jump_cost)
    ends = np.cumsum([a * b for a, b in shapes])[:-1]
    return [part.reshape(shape) for part, shape in zip(np.split(costs, ends), shapes, strict=True)]


def _motion_costs(candidates: Candidates, times: Floats, source: Ints, target: Ints, options: PathOptions) -> Floats:
    """(M,) half the squared Mahalanobis length of the motions from `source` (M,) to `target` (M,)."""
    poses, step = candidates.poses, np.maximum(times[target] - times[source], _SHORTEST_STEP_S)
    turn = poses.rotations[target] @ poses.rotations[source].transpose(0, 2, 1)
    motion = np.concatenate(
        [poses.centers[target] - poses.centers[source], Rotation.from_matrix(turn).as_rotvec()], axis=1
    )
    sigma = step[:, None] * np.repeat([options.speed_m_per_s, np.radians(options.spin_deg_per_s)], 3)
    covariance = candidates.covariance[source] + candidates.covariance[target]
    covariance = covariance + np.einsum("mi,ij->mij", sigma**2, np.eye(6))
    return np.asarray(np.einsum("mi,mi->m", motion, np.linalg.solve(covariance, motion[..., None])[..., 0]) / 2)


def _are_apart(candidates: Candidates, a: int, b: int, options: PathOptions) -> bool:
    poses = candidates.poses
    distance = float(np.linalg.norm(poses.centers[a] - poses.centers[b]))
    cosine = float(np.sum(poses.rotations[a] * poses.rotations[b]) - 1) / 2
    return distance > options.apart_m or cosine < np.cos(np.radians(options.apart_deg))
