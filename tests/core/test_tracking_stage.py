"""The stage that tracks frames: kept with the reconstruction that it is of, and left out where it is not wanted."""

from pathlib import Path

import numpy as np
import pytest
from app_project import make_app_project
from painted_room import Pictures, head_poses, model_of, recording_of

from gazeloc_core import pipeline
from gazeloc_core.errors import Cancelled, ProjectError
from gazeloc_core.localize.tracking import TrackingOptions, track_frames
from gazeloc_core.methods import Method
from gazeloc_core.pipeline import stage_named
from gazeloc_core.project import Project
from gazeloc_core.stages import inputs, tracking
from gazeloc_core.stages.poses import fresh_trajectory, placed_models
from gazeloc_core.storage.artifacts import State

NAME = "walk"
COUNT = 25
IMAGES = [0, 8, 16, 24]


@pytest.fixture
def pictures() -> Pictures:
    """The frames of the recording."""
    return Pictures(head_poses(COUNT))


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, pictures: Pictures) -> Project:
    """A project up to its alignment whose recording and reconstruction are those of a painted room."""
    project = make_app_project(tmp_path)
    poses, opened = pictures.poses, recording_of(pictures)
    monkeypatch.setattr(inputs, "load_recording", lambda project, name: opened)
    models = inputs.model_arrays([model_of(poses, IMAGES)])
    header = project.artifact(NAME, "anchoring").header()
    project.artifact(NAME, "anchoring").write_arrays(models, options={}, inputs=header.inputs)
    header = project.artifact(NAME, "keyframes").header()
    project.artifact(NAME, "keyframes").write_arrays({"keyframes": np.array(IMAGES)}, options={}, inputs=header.inputs)
    return project


def taken() -> np.ndarray:
    return np.isin(np.arange(COUNT), IMAGES)


def run(project: Project, report=None):
    stage = stage_named("tracking")
    return pipeline.run_stage(project, stage, NAME, *([] if report is None else [report]))


def state(project: Project) -> State:
    stage = stage_named("tracking")
    return stage.artifact(project, NAME).state(stage.inputs(project, NAME))[0]


def test_what_was_tracked_is_read_back(project: Project):
    assert state(project) is State.MISSING
    assert run(project).ran
    assert state(project) is State.FRESH
    tracked = tracking.load_tracked(project, NAME)
    assert tracked is not None
    assert tracked.frame_indices.tolist() == [i for i in range(COUNT) if i not in IMAGES]
    stats = project.artifact(NAME, "tracking").header().stats
    assert stats == {"tried": COUNT - len(IMAGES), "tracked": COUNT - len(IMAGES)}
    assert not run(project).ran


def cancel_at(most: float):
    def report(fraction: float, text: str = "", /) -> None:
        if fraction > most:
            raise Cancelled

    return report


def test_cancelled_it_leaves_no_result_and_goes_on_where_it_was(project: Project, pictures: Pictures):
    with pytest.raises(Cancelled):
        run(project, cancel_at(0.5))
    assert state(project) is State.MISSING
    assert tracking.load_tracked(project, NAME) is None
    pictures.read_frames.clear()
    assert run(project).ran
    assert min(pictures.read_frames) == IMAGES[1]  # what lies before was done
    again = tracking.load_tracked(project, NAME)
    whole = track_frames(model_of(pictures.poses, IMAGES), recording_of(pictures), taken())
    np.testing.assert_array_equal(again.centers, whole.tracked.centers)
    assert not list(project.artifact(NAME, "tracking").folder.parent.glob("*.begun.*"))


@pytest.mark.parametrize("content", [b"", b"not arrays", None])
def test_what_was_begun_with_something_else_or_is_damaged_is_done_anew(project, pictures, content):
    with pytest.raises(Cancelled):
        run(project, cancel_at(0.5))
    (begun,) = project.artifact(NAME, "tracking").folder.parent.glob("*.begun.*")
    if content is None:
        tracking.track_between(project, NAME, TrackingOptions(points=150))
    else:
        begun.write_bytes(content)
        pictures.read_frames.clear()
        run(project)
        assert min(pictures.read_frames) == 0
    assert len(tracking.load_tracked(project, NAME)) == COUNT - len(IMAGES)


def test_frames_tracked_in_another_reconstruction_are_not_used(project: Project):
    run(project)
    header = project.artifact(NAME, "anchoring").header()
    moved = inputs.model_arrays([model_of(head_poses(COUNT), IMAGES[:-1])])
    project.artifact(NAME, "anchoring").write_arrays(moved, options={}, inputs=header.inputs)
    assert state(project) is State.STALE
    assert tracking.load_tracked(project, NAME) is None
    assert tracking.tracked_content(project, NAME) is None


def test_poses_and_their_freshness_follow_the_tracked_frames(project: Project):
    for name in ("alignment", "pieces", "trajectory"):
        pipeline.run_stage(project, stage_named(name), NAME)
    assert (fresh_trajectory(project, NAME).status == "interpolated").sum() == COUNT - len(IMAGES)
    run(project)
    with pytest.raises(ProjectError, match="tracked frames"):
        fresh_trajectory(project, NAME)
    pipeline.run_stage(project, stage_named("trajectory"), NAME)
    trajectory = fresh_trajectory(project, NAME)
    assert (trajectory.status == "tracked").sum() == COUNT - len(IMAGES)
    assert trajectory.has_pose.all()


def test_without_tracking_frames_are_interpolated_as_before(project: Project):
    for name in ("alignment", "pieces"):
        pipeline.run_stage(project, stage_named(name), NAME)
    run(project)
    project.choose_tracking(False)
    assert Project.open(project.folder).settings.track_frames is False
    assert "tracking" not in [status.stage for status in pipeline.statuses(project)]
    assert placed_models(project, NAME, Method.SFM)[0].tracked is None
    pipeline.run_stage(project, stage_named("trajectory"), NAME)
    assert set(fresh_trajectory(project, NAME).status) == {"registered", "interpolated"}


def test_damaged_tracks_are_named(project: Project):
    run(project)
    artifact = project.artifact(NAME, "tracking")
    (artifact.folder / "arrays.npz").write_bytes(b"not arrays")
    with pytest.raises(ProjectError, match="damaged"):
        tracking.load_tracked(project, NAME)
