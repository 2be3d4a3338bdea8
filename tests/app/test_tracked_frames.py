"""Tracked frames in the app: shown as what they are, under any alignment at once, gone with their reconstruction."""

import numpy as np
import pytest
from app_project import FRAMES, SFM_FROM_SCAN, make_app_project, true_poses
from app_steps import step, stop
from gazeloc_app.actions.views import ShowFrame
from gazeloc_app.app import App
from gazeloc_app.data import ProjectData
from gazeloc_app.panels.frames import FramePanel

from gazeloc_core.project import Project
from gazeloc_core.stages import registration, tracking
from gazeloc_core.transforms import wxyz_of

TRACKED = np.arange(1, FRAMES - 1, 4)


def write_tracked(project: Project) -> None:
    """As if every fourth frame had been tracked, at its true pose."""
    poses = SFM_FROM_SCAN.compose_pose(true_poses()[TRACKED])
    project.artifact("walk", "tracking").write_arrays(
        {
            "0_frame_indices": TRACKED,
            "0_centers": poses.translation,
            "0_wxyz": wxyz_of(poses.rotation),
            "0_points": np.full(len(TRACKED), 312),
            "0_error_px": np.full(len(TRACKED), 0.42),
        },
        options={},
        inputs=tracking.tracking_inputs(project, "walk"),
    )


@pytest.fixture
def aligned(tmp_path) -> Project:
    project = make_app_project(tmp_path)
    registration.align_keypoints(project, "walk")
    return project


def trajectory_of(project: Project):
    data = ProjectData(project)
    return data.trajectory("walk", project.settings.chosen["walk"].alignment)


def test_tracked_frames_have_their_own_pose_under_the_alignment_in_force(aligned: Project):
    between = trajectory_of(aligned)
    write_tracked(aligned)
    trajectory = trajectory_of(aligned)
    assert np.flatnonzero(trajectory.status == "tracked").tolist() == TRACKED.tolist()
    truth = np.asarray(true_poses()[TRACKED].translation)
    assert np.linalg.norm(trajectory.centers[TRACKED] - truth, axis=1).max() < 0.005
    assert np.linalg.norm(between.centers[TRACKED] - truth, axis=1).max() > 0.005  # where they were interpolated


def test_an_app_that_is_open_sees_what_was_tracked_meanwhile(aligned: Project):
    data = ProjectData(aligned)
    key = aligned.settings.chosen["walk"].alignment
    assert (data.trajectory("walk", key).status == "tracked").sum() == 0
    write_tracked(aligned)
    assert (data.trajectory("walk", key).status == "tracked").sum() == len(TRACKED)
    artifact = aligned.artifact("walk", "anchoring")
    artifact.write_arrays(artifact.read_arrays() | {"extra": np.ones(1)}, options={}, inputs=artifact.header().inputs)
    assert (data.trajectory("walk", key).status == "tracked").sum() == 0  # of another reconstruction now


def test_damaged_tracks_leave_frames_interpolated_and_say_so(aligned: Project):
    write_tracked(aligned)
    (aligned.artifact("walk", "tracking").folder / "arrays.npz").write_bytes(b"not arrays")
    said: list[str] = []
    data = ProjectData(aligned, said.append)
    trajectory = data.trajectory("walk", aligned.settings.chosen["walk"].alignment)
    assert set(trajectory.status) <= {"registered", "interpolated", "none"}
    assert len(said) == 1
    assert "damaged" in said[0]


def test_the_frame_panel_says_what_a_tracked_pose_rests_on(aligned: Project):
    write_tracked(aligned)
    app = App(aligned, port=0)
    app.store._render()
    try:
        step(app, ShowFrame(int(TRACKED[1])))
        (panel,) = (view.__self__ for view in app.store._views if isinstance(view.__self__, FramePanel))
        assert "tracked between keyframes" in panel._facts.content
        assert "Rests on 312 points of the keyframes around it, 0.4 px off." in panel._facts.content
        assert f"tracked {len(TRACKED)}" in panel._timeline.content
        step(app, ShowFrame(int(TRACKED[1]) + 1))
        assert "Rests on" not in panel._facts.content
    finally:
        stop(app)
