"""Methods in the app: chosen per recording, saved, compared in the scene, in a table and in renders."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from app_project import true_poses
from app_steps import step, wait_for_job
from gazeloc_app.actions.choices import ChooseMethod, CompareMethod
from gazeloc_app.actions.history import Undo
from gazeloc_app.actions.jobs import JobEnded, StartJob
from gazeloc_app.actions.views import DrawTags, ShowFrame
from gazeloc_app.frames.support_text import tag_support_text
from gazeloc_app.panels.methods import MethodPanel
from gazeloc_app.state import Level
from gazeloc_app.work import tasks

from gazeloc_core.methods import Method
from gazeloc_core.project import Project
from gazeloc_core.stages import inputs
from gazeloc_core.stages.poses import fresh_methods
from gazeloc_core.trajectory import PoseStatus, Trajectory


def panel(app) -> MethodPanel:
    return next(view.__self__ for view in app.store._views if isinstance(getattr(view, "__self__", None), MethodPanel))


def write_poses(project: Project, method: Method, off_m: float) -> None:
    """What the method would have left: every second frame, off by a known distance."""
    poses = true_poses()
    count = len(poses)
    is_seen = np.arange(count) % 2 == 0
    centers = np.where(is_seen[:, None], np.add(poses.translation, (off_m, 0, 0)), np.nan)
    wxyz = np.where(is_seen[:, None], poses.rotation.as_quat(scalar_first=True), np.nan)
    times = inputs.load_recording(project, "walk").timestamp_ns
    status = np.where(is_seen, PoseStatus.TAG_ONLY.value, PoseStatus.NONE.value)
    trajectory = Trajectory(times, status, np.ones(count, bool), centers, wxyz)
    project.result("walk", method, "trajectory").write_arrays(
        inputs.trajectory_arrays(trajectory), options={}, inputs={"made": "up"}
    )


def test_a_method_is_chosen_saved_and_undone(app, project):
    step(app, ChooseMethod(Method.TAGS))
    assert Project.open(project.folder).method("walk") is Method.TAGS
    step(app, Undo())
    assert Project.open(project.folder).method("walk") is Method.SFM


def test_the_chosen_method_is_red_and_others_have_their_own_colours(app, project):
    nodes = app.server.scene._handle_from_node_name
    write_poses(project, Method.TAGS, 0.05)
    write_poses(project, Method.TAGS_PAPER, 0.30)
    step(app, JobEnded(Level.INFO, "run"), ChooseMethod(Method.TAGS))
    assert "/frusta/estimate" in nodes
    assert "/frusta/methods/tags-paper" not in nodes
    step(app, CompareMethod(Method.TAGS_PAPER, True))
    assert "/frusta/methods/tags-paper" in nodes
    step(app, ChooseMethod(Method.TAGS_PAPER))
    assert "/frusta/methods/tags-paper" not in nodes, "the chosen one is red already"
    step(app, CompareMethod(Method.TAGS_PAPER, False), ChooseMethod(Method.TAGS))
    assert "/frusta/methods/tags-paper" not in nodes


def test_the_table_says_frames_errors_and_how_far_methods_are_apart(app, project):
    write_poses(project, Method.TAGS, 0.05)
    write_poses(project, Method.TAGS_PAPER, 0.30)
    step(app, JobEnded(Level.INFO, "run"), ChooseMethod(Method.TAGS))
    table = panel(app)._table.content
    for text in ("8 of 16", "5.0 cm", "30.0 cm", "25.0 cm", "0.00°", "not run"):
        assert text in table


def test_renders_of_compared_methods_stand_side_by_side_and_say_where_there_is_no_pose(app, project):
    write_poses(project, Method.TAGS, 0.05)
    write_poses(project, Method.TAGS_PAPER, 0.30)
    step(app, JobEnded(Level.INFO, "run"), ChooseMethod(Method.TAGS), CompareMethod(Method.TAGS_PAPER, True))
    step(app, ShowFrame(2))
    assert panel(app)._renders.content.count("<img") == 2
    step(app, ShowFrame(3))
    assert panel(app)._renders.content.count("<img") == 0
    assert panel(app)._renders.content.count("no pose") == 2


def test_a_method_that_cannot_run_is_a_sentence(app, project):
    keywords = (("recording", "walk"), ("method", Method.SFM_PAPER))
    step(app, StartJob("Run sfm-paper", tasks.run_all, keywords))
    wait_for_job(app)
    assert app.store.state.notice.level is Level.ERROR
    assert "three tags on both sides" in app.store.state.notice.text
    assert Method.SFM_PAPER not in fresh_methods(project, "walk")


def test_drawing_tags_changes_the_frames_url_only(app):
    before = app.store.state
    step(app, DrawTags(True))
    assert app.store.state.layers.draws_tags
    assert app.store.state.annotation == replace(before.annotation, layers=app.store.state.layers)


def test_the_frame_says_what_a_pose_by_tags_rests_on(app, project):
    write_poses(project, Method.TAGS, 0.05)
    artifact = project.result("walk", Method.TAGS, "trajectory")
    columns = artifact.read_arrays()
    count = len(columns["timestamp_ns"])
    is_seen = np.arange(count) % 2 == 0
    columns |= {
        "tags_used": np.where(is_seen, 2, 0),
        "disagreement_m": np.where(is_seen, 0.034, np.nan),
        "is_ambiguous": ~is_seen,
    }
    artifact.write_arrays(columns, options={}, inputs={"made": "up"})
    read = app.data.tag_columns("walk", Method.TAGS)
    assert tag_support_text(read, 2) == "Rests on 2 tags; the worst is 3.4 cm from its place."
    assert tag_support_text(read, 3) == "Its tag has two possible poses."
    assert app.data.tag_columns("walk", Method.SFM) is None
    assert tag_support_text(None, 2) == ""


def test_figures_are_drawn_where_there_is_something_to_draw_and_say_what_is_missing(app, project):
    step(app, StartJob("Draw the figures", tasks.draw_figures, (("recording", "walk"),)))
    wait_for_job(app)
    charts, notes = app.data.figures("walk")
    assert list(charts) == ["Figure 8"], "the small project has a truth, but no sightings of tags"
    assert sum("no tag was found" in note for note in notes) == 2
