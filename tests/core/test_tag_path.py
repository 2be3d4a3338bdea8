"""The choice among candidates over time, against all paths tried one by one."""

import itertools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gazeloc_core.localize.resection import CameraPoses
from gazeloc_core.localize.tag_candidates import Candidates
from gazeloc_core.localize.tag_path import PathOptions, are_tied, choose_path
from gazeloc_core.localize.tag_path import _gaps as gaps

OPTIONS = PathOptions(skip_cost=1.5, jump_cost=7.0)


def candidates(frames: list[int], costs: list[float], centers: np.ndarray, sigma_m: float = 0.02) -> Candidates:
    count = len(frames)
    covariance = np.tile(np.diag([sigma_m**2] * 3 + [np.radians(1) ** 2] * 3), (count, 1, 1))
    poses = CameraPoses(np.asarray(centers, float), np.tile(np.eye(3), (count, 1, 1)))
    rows = np.arange(count)
    return Candidates(np.array(frames), poses, covariance, np.array(costs, float), rows, rows, np.ones(count, bool))


def cost_of_path(c: Candidates, seconds: np.ndarray, path: list[int], options: PathOptions, frames: int) -> float:
    """The definition: what is taken, what is left out, and each step, which costs no more than a jump."""
    total = sum(c.cost[row] for row in path) + options.skip_cost * (frames - len(path))
    for a, b in itertools.pairwise(path):
        dt = seconds[c.frame[b]] - seconds[c.frame[a]]
        sigma2 = (options.speed_m_per_s * dt) ** 2 + c.covariance[a, 0, 0] + c.covariance[b, 0, 0]
        step = np.sum((c.poses.centers[b] - c.poses.centers[a]) ** 2) / sigma2 / 2
        total += min(step, options.jump_cost)
    return float(total)


@pytest.mark.parametrize("seed", range(8))
def test_the_gaps_are_those_of_all_paths(seed):
    rng = np.random.default_rng(seed)
    frames = [0, 0, 1, 2, 2, 2, 5, 5, 6]
    c = candidates(frames, rng.uniform(-10, 2, 9).tolist(), rng.normal(0, 0.4, (9, 3)))
    seconds = np.cumsum(rng.uniform(0.02, 0.2, 8))
    rows_of = [[row for row in range(9) if frames[row] == f] for f in sorted(set(frames))]
    best = np.full(9, np.inf)
    for choice in itertools.product(*[[None, *rows] for rows in rows_of]):
        path = [row for row in choice if row is not None]
        if path:
            cost = cost_of_path(c, seconds, path, OPTIONS, len(rows_of))
            best[path] = np.minimum(best[path], cost)
    bounds = [0, 2, 3, 6, 8, 9]
    np.testing.assert_allclose(gaps(c, seconds, bounds, OPTIONS), best - best.min(), atol=1e-9)


def walk(count: int, seed: int = 0) -> tuple[list[int], list[float], np.ndarray, np.ndarray]:
    """Right candidates (even rows) that walk along x, and wrong ones that lie anywhere; equal in cost."""
    rng = np.random.default_rng(seed)
    right = np.column_stack([np.arange(count) * 0.02, np.zeros(count), np.zeros(count)])
    centers = np.stack([right, right + rng.normal(0, 1, (count, 3))], axis=1).reshape(-1, 3)
    return np.repeat(np.arange(count), 2).tolist(), [-9.0] * (2 * count), centers, np.arange(count) / 30


def test_neighbours_tell_two_equal_candidates_apart():
    frames, costs, centers, seconds = walk(12)
    chosen = choose_path(candidates(frames, costs, centers), seconds, PathOptions())
    assert chosen.candidate.tolist() == list(range(0, 24, 2))
    assert not chosen.is_open.any()


def test_without_neighbours_two_equal_candidates_stay_open():
    c = candidates([3, 3], [-9.0, -9.0], np.array([[0, 0, 0], [0.5, 0, 0]]))
    assert choose_path(c, np.arange(5) / 30, PathOptions()).is_open.tolist() == [True]


def test_two_places_that_are_nearly_the_same_leave_nothing_open():
    c = candidates([3, 3], [-9.0, -9.0], np.array([[0, 0, 0], [0.05, 0, 0]]))
    assert choose_path(c, np.arange(5) / 30, PathOptions()).is_open.tolist() == [False]


def test_a_frame_that_contradicts_its_neighbours_is_left_out():
    frames, costs, centers, seconds = walk(9)
    c = candidates(frames, costs, centers).pick(np.array([*range(0, 8, 2), 9, *range(10, 18, 2)]))
    chosen = choose_path(c, seconds, PathOptions())
    assert chosen.candidate.tolist() == [0, 1, 2, 3, -1, 5, 6, 7, 8]


def test_a_recording_may_jump_once():
    frames, costs, centers, seconds = walk(20)
    centers[20:] += [3.0, 0, 0]  # as if the video had been cut
    c = candidates(frames, costs, centers).pick(np.arange(0, 40, 2))
    chosen = choose_path(c, seconds, PathOptions())
    assert (chosen.candidate >= 0).all()
    assert np.flatnonzero(~are_tied(c, seconds, PathOptions())).tolist() == [9]


def test_a_turn_counts_as_a_shift_does():
    c = candidates([0, 1, 1, 2], [-9.0, -9.0, -9.0, -9.0], np.zeros((4, 3)))
    turned = c.poses.rotations.copy()
    turned[1] = Rotation.from_euler("y", 60, degrees=True).as_matrix()
    c = Candidates(c.frame, CameraPoses(c.poses.centers, turned), c.covariance, c.cost, c.owner, c.views, c.is_used)
    assert choose_path(c, np.arange(3) / 30, PathOptions()).candidate.tolist() == [0, 2, 3]
