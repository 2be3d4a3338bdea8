"""Errors are the paper's, over the frames that the issue names, and infinite where nothing was localised."""

import json
import math

import numpy as np
import pytest
from box_room import camera_poses
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import RigidTransform, Rotation

from gazeloc_core.errors import GeometryError
from gazeloc_core.evaluation.evaluate import evaluate, match_times, pose_errors
from gazeloc_core.evaluation.trajectory_errors import ErrorSummary
from gazeloc_core.trajectory import Trajectory

TIMES = 1_700_000_000_000_000_000 + 33_333_333 * np.arange(20)


def trajectory_of(status, keyframes, shift_m=0.0) -> Trajectory:
    status = np.array(status)
    has_pose = np.flatnonzero(np.isin(status, ["registered", "tracked", "interpolated", "tag_only"]))
    poses = camera_poses(20)[has_pose]
    shift = np.broadcast_to(np.asarray(shift_m, float), (20,))[has_pose]
    moved = RigidTransform.from_components(poses.translation + shift[:, None] * [0, 0, 1], poses.rotation)
    return Trajectory.from_poses(TIMES, status, np.isin(np.arange(20), keyframes), has_pose, moved)


vectors = st.lists(st.floats(-3, 3), min_size=3, max_size=3)


@given(vectors, vectors, vectors, vectors)
@settings(max_examples=200)
def test_errors_are_those_of_the_paper(first_turn, second_turn, first_place, second_place):
    """Section VI-B: arccos((trace(R_gt^T R_es) - 1) / 2), and the distance of the camera centres."""
    truth, found = Rotation.from_rotvec(first_turn), Rotation.from_rotvec(second_turn)
    rotation_deg, position_m = pose_errors(
        RigidTransform.from_components(second_place, found), RigidTransform.from_components(first_place, truth)
    )
    trace = np.trace(truth.as_matrix().T @ found.as_matrix())
    assert math.cos(math.radians(rotation_deg[0])) == pytest.approx((trace - 1) / 2, abs=1e-9)
    assert position_m[0] == pytest.approx(math.dist(first_place, second_place), abs=1e-12)


@given(vectors, vectors)
@settings(max_examples=100)
def test_errors_do_not_depend_on_the_axes_of_the_scan(turn, place):
    poses, others = camera_poses(5), camera_poses(5, seed=3)
    moved = RigidTransform.from_components(place, Rotation.from_rotvec(turn))
    for first, second in zip(pose_errors(poses, others), pose_errors(moved * poses, moved * others), strict=True):
        np.testing.assert_allclose(first, second, atol=1e-7)


def test_small_turns_keep_their_digits():
    turn = RigidTransform.from_rotation(Rotation.from_rotvec([1e-9, 0, 0]))
    assert pose_errors(turn, RigidTransform.identity())[0][0] == pytest.approx(np.rad2deg(1e-9), rel=1e-6)


def test_a_perfect_trajectory_has_no_error():
    evaluation = evaluate(trajectory_of(["registered"] * 20, range(0, 20, 2)), TIMES, camera_poses(20))
    assert (evaluation.frames, evaluation.keyframes, evaluation.registered) == (20, 10, 10)
    for summary in (evaluation.position_m, evaluation.rotation_deg):
        assert max(summary.mean, summary.median, summary.p95, summary.max) < 1e-5


def test_nothing_is_aligned_to_the_truth():
    evaluation = evaluate(trajectory_of(["registered"] * 20, range(20), shift_m=0.3), TIMES, camera_poses(20))
    assert evaluation.position_m.mean == pytest.approx(0.3)


def test_only_keyframes_that_were_localised_themselves_count():
    """Frame 0 and 1 registered, 2 interpolated, 3 none (all keyframes); 4 registered but no keyframe, far off."""
    status = ["registered", "tag_only", "interpolated", "none", "registered"] + ["none"] * 15
    shift = np.array([0.1, 0.3, 9, 0, 9] + [0] * 15)
    evaluation = evaluate(trajectory_of(status, range(4), shift), TIMES, camera_poses(20))
    assert (evaluation.keyframes, evaluation.registered) == (4, 2)
    assert evaluation.position_m.mean == pytest.approx(0.2)
    assert evaluation.position_m.median == pytest.approx(0.2)
    assert evaluation.position_m.max == pytest.approx(0.3)
    assert evaluation.position_m.p95 == math.inf
    assert evaluation.frame_index.tolist() == [0, 1, 2, 4]
    np.testing.assert_allclose(evaluation.frame_position_m, [0.1, 0.3, 9, 9])


def test_all_frames_are_told_apart_by_how_they_came_by_their_pose():
    """Keyframes or not; nothing of one status counts for another, and what has no pose is in none."""
    status = ["registered", "tracked", "tracked", "interpolated", "none"] + ["none"] * 15
    shift = np.array([0.1, 0.2, 0.4, 9, 0] + [0] * 15)
    evaluation = evaluate(trajectory_of(status, [0], shift), TIMES, camera_poses(20))
    found = evaluation.to_json()["by_status"]
    assert {name: errors["frames"] for name, errors in found.items()} == {
        "registered": 1,
        "tracked": 2,
        "interpolated": 1,
    }
    assert found["tracked"]["position_m"]["mean"] == pytest.approx(0.3)
    assert found["interpolated"]["position_m"]["max"] == pytest.approx(9)
    assert evaluation.position_m.mean == pytest.approx(0.1)


def test_a_keyframe_that_was_tracked_counts_as_registered():
    status = ["registered", "tracked"] + ["none"] * 18
    evaluation = evaluate(trajectory_of(status, [0, 1, 2]), TIMES, camera_poses(20))
    assert (evaluation.keyframes, evaluation.registered) == (3, 2)


def test_p95_is_infinite_when_more_than_one_keyframe_in_twenty_failed():
    errors = np.linspace(0.01, 1.0, 100)
    assert ErrorSummary.of(errors).p95 == pytest.approx(np.percentile(errors, 95))
    errors[:4] = math.inf
    assert ErrorSummary.of(errors).p95 == pytest.approx(np.sort(errors)[94] * 0.95 + np.sort(errors)[95] * 0.05)
    errors[:6] = math.inf
    assert ErrorSummary.of(errors).p95 == math.inf
    assert ErrorSummary.of(errors).max == 1.0


def test_json_is_strict_and_null_means_infinite():
    evaluation = evaluate(trajectory_of(["none"] * 20, range(20)), TIMES, camera_poses(20))
    value = json.loads(json.dumps(evaluation.to_json(), allow_nan=False))
    first_keys = ["frames", "keyframes", "registered", "without_truth", "rotation_deg", "position_m"]
    assert list(value) == [*first_keys, "outliers", "ate_m", "rpe", "by_status", "by_mark", "left_out"]
    assert value["by_status"] == {}
    assert value["registered"] == 0
    assert value["position_m"] == dict.fromkeys(["mean", "median", "p75", "p90", "p95", "max"])
    assert value["outliers"] == {"frames": 0, "position": 0, "rotation": 0, "count": 0, "share": None}
    assert value["ate_m"] == {"frames": 0, "unaligned": None, "se3_aligned": None, "sim3_aligned": None}
    assert {pairs: errors["pairs"] for pairs, errors in value["rpe"].items()} == {"in_order": 0, "per_second": 0}


def test_times_match_within_a_millisecond_and_to_the_nearest():
    frames = np.array([0, 10, 20, 30]) * 1_000_000
    truth = np.array([10_400_000, 9_800_000, 21_000_001, 31_000_000])
    assert match_times(frames, truth).tolist() == [-1, 1, -1, 3]
    assert match_times(frames, np.zeros(0, int)).tolist() == [-1] * 4


def test_keyframes_without_truth_are_counted_and_not_judged():
    trajectory = trajectory_of(["registered"] * 19 + ["none"], range(20), 0.1)
    evaluation = evaluate(trajectory, TIMES[:15], camera_poses(20)[:15])
    assert evaluation.without_truth == 5
    assert evaluation.position_m.p95 == pytest.approx(0.1)


def test_the_truth_of_another_recording_is_refused():
    with pytest.raises(GeometryError, match="within 1 ms"):
        evaluate(trajectory_of(["registered"] * 20, range(20)), TIMES + 10**12, camera_poses(20))
