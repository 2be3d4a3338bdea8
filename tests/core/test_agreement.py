"""The agreement of a frame with the scan: high at the true pose whatever the exposure, lower the further it is off."""

import cv2
import numpy as np
import pytest
from app_project import LENS, make_app_project, room_mesh, true_poses
from scipy.spatial.transform import RigidTransform, Rotation

from gazeloc_core.errors import Cancelled
from gazeloc_core.evaluation.agreement import LOW_SCORE, FrameScorer
from gazeloc_core.methods import Method
from gazeloc_core.pipeline import SCORES, run_after_choice, run_stage
from gazeloc_core.stages import scores
from gazeloc_core.stages.registration import align_keypoints
from gazeloc_core.surfaces.render import RayRenderer

POSE = true_poses()[5]


@pytest.fixture(scope="module")
def scorer():
    return FrameScorer(room_mesh(), LENS)


@pytest.fixture(scope="module")
def frame():
    return RayRenderer(room_mesh()).render(LENS, POSE).rgb


def moved(pose, *, right_m=0.0, turned_deg=0.0):
    there = RigidTransform.from_components([right_m, 0, 0], Rotation.from_rotvec([0, np.radians(turned_deg), 0]))
    return pose * there


def test_the_true_pose_agrees_whatever_the_exposure_and_some_blur(scorer, frame):
    dark = (cv2.GaussianBlur(frame, (0, 0), 1.5) * 0.4 + 20).astype(np.uint8)
    for picture in (frame, dark):
        found = scorer.score(picture, POSE)
        assert found.score > 0.7
        assert found.offset_deg < 0.2  # a pixel is 0.22°


def test_the_further_off_a_pose_is_the_lower_its_score(scorer, frame):
    for key, sizes in (("right_m", (0, 0.02, 0.05, 0.12)), ("turned_deg", (0, 0.5, 1, 2, 4))):
        found = [scorer.score(frame, moved(POSE, **{key: size})).score for size in sizes]
        assert (np.diff(found) < 0).all(), (key, found)


def test_the_offset_is_the_angle_by_which_the_pose_is_turned(scorer, frame):
    assert scorer.score(frame, moved(POSE, turned_deg=1.0)).offset_deg == pytest.approx(1.0, abs=0.15)


def test_another_place_of_the_room_does_not_agree(scorer, frame):
    away = RigidTransform.from_components([0.4, 0.2, 0.3], Rotation.from_rotvec([0.2, 0.9, 0.1]))
    found = scorer.score(frame, POSE * away)
    assert not found.score > 0.2
    assert np.isnan([found.shift_m, found.turn_deg, found.offset_deg]).all()  # a few centimetres, it would say


def test_a_frame_that_shows_nothing_has_no_score(scorer, frame):
    away_from_the_scan = RigidTransform.from_components([500, 0, 0], POSE.rotation)
    assert np.isnan(scorer.score(frame, away_from_the_scan).score)


@pytest.fixture
def project(tmp_path):
    project = make_app_project(tmp_path)
    align_keypoints(project, "walk")
    run_after_choice(project, "walk", Method.SFM)
    return project


def test_every_frame_with_a_pose_is_scored_and_the_others_are_not(project):
    run_stage(project, SCORES[Method.SFM], "walk")
    trajectory = project.result("walk", Method.SFM, "trajectory").read_arrays()
    found = scores.load_scores(project.result("walk", Method.SFM, "scores"), len(trajectory["status"]))
    has_pose = np.isfinite(trajectory["centers"]).all(axis=1)
    assert has_pose.sum() > 5
    np.testing.assert_array_equal(np.isfinite(found.score), has_pose)
    assert found.score[has_pose].min() > LOW_SCORE


@pytest.mark.parametrize("at", [5, 12])  # while frames are compared with each other, and after
def test_what_was_scored_before_a_cancel_is_not_scored_again(project, monkeypatch, at):
    asked = []
    real = FrameScorer.match

    def counted(self, rgb, pose):
        asked.append(pose)
        return real(self, rgb, pose)

    def cancel_at_the_fifth(fraction, text="", /):
        if len(asked) == at and fraction > 0:
            raise Cancelled("Cancelled.")

    monkeypatch.setattr(scores, "_COMPARED_FRAMES", 9)
    monkeypatch.setattr(FrameScorer, "match", counted)
    with pytest.raises(Cancelled):
        scores.score_frames(project, "walk", report=cancel_at_the_fifth)
    assert not project.result("walk", Method.SFM, "scores").exists
    found = scores.score_frames(project, "walk")
    assert np.isfinite(found.score).sum() == 15
    assert len(asked) == np.isfinite(found.score).sum()
    assert not list((project.folder / "recordings" / "walk" / "sfm").glob("scores.begun*"))


def test_a_damaged_file_of_what_was_begun_is_not_used(project):
    folder = project.folder / "recordings" / "walk" / "sfm"
    expected = scores.score_frames(project, "walk")
    path = folder / "scores.begun.npz"
    for arrays in ({}, {"of": np.array("another"), "done": np.arange(3)}, {"of": np.array([1, 2])}):
        np.savez(path, **arrays)
        np.testing.assert_array_equal(scores.score_frames(project, "walk").score, expected.score)
    for content in (b"", b"PK", b"[]"):
        path.write_bytes(content)
        np.testing.assert_array_equal(scores.score_frames(project, "walk").score, expected.score)
