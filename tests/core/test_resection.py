"""Poses from squares whose places are known: exact ones, outliers, and what near and far squares count."""

import numpy as np
import pytest
from box_room import PINHOLE, true_tag_corners
from scipy.spatial.transform import Rotation

from gazeloc_core.localize.resection import (
    CameraPoses,
    SeenSquares,
    TagErrors,
    distances_m,
    errors_px,
    pose_jacobian,
    resect,
)

SQUARES = true_tag_corners().corners[[0, 2, 3, 5]]
FOCAL = PINHOLE.focal_px


def views_from(pose: CameraPoses, squares: np.ndarray = SQUARES, seed: int = 0) -> SeenSquares:
    """Exact views of all squares, whether in the picture or not; they only have to be in front."""
    local = (squares - pose.centers[0]) @ pose.rotations[0]
    assert (local[..., 2] > 0.1).all()
    count = len(squares)
    return SeenSquares(
        np.zeros(count, np.int64), squares, local[..., :2] / local[..., 2:], FOCAL, np.arange(count) == seed
    )


def looking_at_all() -> CameraPoses:
    """A camera beyond the wall with tag 1, so that tags 0, 2, 3 and 5 are in front of it."""
    forward = np.array([-1.0, 0, 0])
    axes = np.column_stack([np.cross([0, -1.0, 0], forward), [0, -1.0, 0], forward])
    return CameraPoses(np.array([[3.5, 0.2, 0.1]]), axes[None])


def moved(pose: CameraPoses, shift_m: float, turn_deg: float, seed: int) -> CameraPoses:
    rng = np.random.default_rng(seed)
    a, b = (v / np.linalg.norm(v) for v in rng.normal(size=(2, 3)))
    return pose.moved(np.concatenate([shift_m * a, np.radians(turn_deg) * b])[None])


def off(a: CameraPoses, b: CameraPoses) -> tuple[float, float]:
    turn = Rotation.from_matrix(a.rotations[0].T @ b.rotations[0]).magnitude()
    return float(np.linalg.norm(a.centers[0] - b.centers[0])), float(np.degrees(turn))


@pytest.mark.parametrize("seed", range(5))
def test_exact_views_lead_back_to_the_exact_pose(seed):
    truth = looking_at_all()
    answer = resect(views_from(truth), moved(truth, 0.3, 5, seed), TagErrors())
    shift_m, turn_deg = off(answer.poses, truth)
    assert shift_m < 1e-6
    assert turn_deg < 1e-5
    assert answer.chi2.max() < 1e-6


def test_the_jacobian_is_that_of_the_errors():
    pose = moved(looking_at_all(), 0.1, 3, 7)
    views = views_from(looking_at_all())
    claimed = pose_jacobian(views, pose)
    for unknown in range(6):
        step = np.zeros((1, 6))
        step[0, unknown] = 1e-6
        measured = (errors_px(views, pose.moved(step)) - errors_px(views, pose.moved(-step))) / 2e-6
        np.testing.assert_allclose(claimed[..., unknown], measured, rtol=1e-4, atol=1e-3)


def test_a_square_in_the_wrong_place_is_left_out_and_named():
    truth = looking_at_all()
    views = views_from(truth)
    squares = SQUARES.copy()
    squares[2] += [0.0, 0.3, 0.2]
    wrong = SeenSquares(views.pose, squares, views.normalised, FOCAL, views.is_seed)
    answer = resect(wrong, moved(truth, 0.1, 2, 1), TagErrors())
    shift_m, _ = off(answer.poses, truth)
    assert shift_m < 0.002
    assert TagErrors().agrees(answer.chi2).tolist() == [True, True, False, True]
    assert distances_m(wrong, answer.poses)[2] == pytest.approx(0.36, abs=0.1)


def test_squares_behind_the_camera_never_agree():
    truth = looking_at_all()
    views = views_from(truth)
    behind = SQUARES.copy()
    behind[2] = behind[2] + [9.0, 0, 0]
    answer = resect(SeenSquares(views.pose, behind, views.normalised, FOCAL, views.is_seed), truth, TagErrors())
    assert not TagErrors().agrees(answer.chi2)[2]
    assert off(answer.poses, truth)[0] < 0.01


def test_the_covariance_is_the_spread_over_noise():
    truth, errors = looking_at_all(), TagErrors(corner_error_px=0.5, place_error_m=1e-6)
    exact, draws = views_from(truth), 400
    noise = np.random.default_rng(2).normal(0, 0.5, (draws, *exact.normalised.shape)) / FOCAL
    every = SeenSquares(
        np.repeat(np.arange(draws), len(SQUARES)),
        np.tile(SQUARES, (draws, 1, 1)),
        (exact.normalised + noise).reshape(-1, 4, 2),
        FOCAL,
        np.tile(exact.is_seed, draws),
    )
    answer = resect(every, truth[np.zeros(draws, np.int64)], errors)
    claimed = np.sqrt(np.diag(answer.covariance[0])[:3])
    np.testing.assert_allclose(np.std(answer.poses.centers, axis=0), claimed, rtol=0.15)


def test_a_centimetre_of_a_near_square_does_not_outvote_a_far_one():
    truth = looking_at_all()
    near = SQUARES[0] * 0.3 + truth.centers[0] + np.array([-0.7, -0.1, -0.1]) - SQUARES[0].mean(axis=0) * 0.3
    squares = np.concatenate([near[None], SQUARES])
    seen = views_from(truth, squares, seed=1)
    off_by_a_centimetre = squares.copy()
    off_by_a_centimetre[0] += [0, 0.01, 0]
    wrong = SeenSquares(seen.pose, off_by_a_centimetre, seen.normalised, FOCAL, seen.is_seed)
    trusting = resect(wrong, truth, TagErrors(place_error_m=1e-6, outlier=1e3))
    knowing = resect(wrong, truth, TagErrors(place_error_m=0.01, outlier=1e3))
    assert off(knowing.poses, truth)[0] < 0.85 * off(trusting.poses, truth)[0]
