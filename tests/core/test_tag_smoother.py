"""The joint adjustment over time: its answer is the least of its cost, and it ties what belongs together, no more."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tag_walk import PINHOLE, Walk, true_tag_corners, walk

from gazeloc_core.localize.resection import CameraPoses, SeenSquares, TagErrors
from gazeloc_core.localize.tag_smoother import SmootherOptions, TagChain, _Problem, _State, smooth
from gazeloc_core.tags.pose import normalised_corners

ERRORS = TagErrors(place_error_m=1e-6)
TAGS = true_tag_corners()


def chain_of(path: Walk) -> tuple[TagChain, CameraPoses]:
    """The chain of the frames that show a tag, and their true poses."""
    s = path.sightings
    views = SeenSquares(
        np.searchsorted(path.shown, s.frame_index),
        TAGS.corners[s.tag_id],
        normalised_corners(s.corners_px, PINHOLE),
        PINHOLE.focal_px,
        np.ones(len(s), np.bool_),
    )
    seconds = (path.timestamp_ns[path.shown] - path.timestamp_ns[0]) / 1e9
    true = path.truth[path.shown]
    chain = TagChain(views, seconds, np.ones(len(seconds) - 1, np.bool_))
    return chain, CameraPoses(np.array(true.translation), true.rotation.as_matrix())


def shaken(poses: CameraPoses, shift_m: float, turn_deg: float, seed: int = 0) -> CameraPoses:
    rng, count = np.random.default_rng(seed), len(poses)
    change = [rng.normal(0, shift_m, (count, 3)), rng.normal(0, np.radians(turn_deg), (count, 3))]
    return poses.moved(np.concatenate(change, axis=1))


def test_its_answer_is_the_least_of_its_cost():
    chain, true = chain_of(walk(seconds=4, noise_px=0.4, edge_px=0.3))
    problem = _Problem(chain, ERRORS, SmootherOptions())
    state = _State(shaken(true, 0.03, 1), np.zeros((len(true), 6)), 0.0)
    for _ in range(12):
        state = problem.step(state, 0.0)
    least = problem.cost(state)
    rng = np.random.default_rng(1)
    for size in (1e-2, 1e-3):
        for _ in range(40):
            move = rng.normal(size=(2, len(true), 6)) * size * (rng.random((2, len(true), 1)) < 0.2)
            other = _State(state.poses.moved(0.1 * move[0]), state.velocity + move[1], state.edge_px)
            assert problem.cost(other) > least
        for edge in (-size, size):
            assert problem.cost(_State(state.poses, state.velocity, state.edge_px + edge)) > least
    assert smooth(chain, shaken(true, 0.03, 1), ERRORS).edge_shift_px == pytest.approx(state.edge_px, abs=0.01)


def test_the_light_on_edges_is_measured():
    chain, true = chain_of(walk(seconds=4, noise_px=0.1, edge_px=0.4))
    assert smooth(chain, shaken(true, 0.02, 1), ERRORS).edge_shift_px == pytest.approx(0.4, abs=0.15)


def test_frames_that_are_not_tied_do_not_know_of_each_other():
    chain, true = chain_of(walk(seconds=1, noise_px=0.4))
    cut = len(true) // 2
    is_tied = chain.is_tied.copy()
    is_tied[cut - 1] = False
    start = shaken(true, 0.02, 1)
    still = SmootherOptions(edge_shift_error_px=1e-6)  # the one unknown that all frames share
    answer = smooth(TagChain(chain.views, chain.seconds, is_tied), start, ERRORS, still)
    mine = chain.views.pose < cut
    alone = TagChain(chain.views.pick(mine), chain.seconds[:cut], chain.is_tied[: cut - 1])
    expected = smooth(alone, start[np.arange(cut)], ERRORS, still)
    np.testing.assert_allclose(answer.poses.centers[:cut], expected.poses.centers, atol=1e-4)


def test_one_false_tag_is_outvoted_and_one_frame_is_no_chain():
    chain, true = chain_of(walk(seconds=2, noise_px=0.1))
    false = chain.views.normalised.copy()
    middle = len(false) // 2
    false[middle] += 0.2
    views = SeenSquares(chain.views.pose, chain.views.corners, false, PINHOLE.focal_px, chain.views.is_seed)
    answer = smooth(TagChain(views, chain.seconds, chain.is_tied), true, ERRORS)
    assert np.flatnonzero(~ERRORS.agrees(answer.chi2)).tolist() == [middle]
    single = chain.views.pick(chain.views.pose == 0)
    one = smooth(TagChain(single, chain.seconds[:1], chain.is_tied[:0]), true[:1], ERRORS)
    turn = Rotation.from_matrix(one.poses.rotations[0].T @ true.rotations[0]).magnitude()
    assert np.degrees(turn) < 5
