"""The panel of problems: scores of the poses that are shown and of no others, the list by what people chose."""

from __future__ import annotations

import numpy as np
import pytest
from app_project import make_app_project
from app_steps import step, stop, wait_for_job
from gazeloc_app.actions.choices import ChooseAlignment
from gazeloc_app.actions.jobs import StartJob
from gazeloc_app.actions.marks import MarkFrame, NoteFrame
from gazeloc_app.actions.views import ShowFrame
from gazeloc_app.app import App
from gazeloc_app.panels.problems import ProblemPanel, Which
from gazeloc_app.work import tasks

from gazeloc_core.frames.marks import Mark
from gazeloc_core.project import Chosen
from gazeloc_core.stages.registration import align_keypoints


@pytest.fixture
def app(tmp_path):
    project = make_app_project(tmp_path)
    alignment = align_keypoints(project, "walk")
    project.choose("walk", Chosen(alignment=alignment.key, by_person=True))
    app = App(project, port=0)
    app.store._render()
    yield app
    stop(app)


def panel(app):
    return next(view.__self__ for view in app.store._views if isinstance(view.__self__, ProblemPanel))


def choose(app, which):
    panel(app)._which.value = which
    panel(app)._render_list()
    return panel(app)._list.content


def scores(app):
    state = app.store.state
    return app.data.scores("walk", app.data.poses_key("walk", state.annotation))


def test_frames_are_scored_by_a_job_and_shown_for_these_poses_alone(app):
    assert "Nothing is scored yet" in panel(app)._summary.content
    step(app, StartJob("Score the frames", tasks.score_frames, (("recording", "walk"),)))
    wait_for_job(app)
    assert app.store.state.notice.text.startswith("15 frames were scored")
    found = scores(app)
    assert np.isfinite(found).sum() == 15
    assert "15 frames are scored" in panel(app)._summary.content
    worst = int(np.nanargmin(found))
    assert panel(app)._list.content.index(f"<b>Frame {worst}</b>") == panel(app)._list.content.index("<b>Frame ")
    found = app.data.frame_scores("walk", app.data.poses_key("walk", app.store.state.annotation))
    assert (
        f"looks {100 * found.shift_m[worst]:.1f} ± {100 * found.shift_sigma_m[worst]:.1f} cm"
        in panel(app)._list.content
    )
    step(app, ChooseAlignment(None))
    assert not np.isfinite(scores(app)).any()


def test_the_list_has_what_people_marked_with_their_notes_escaped(app):
    step(app, ShowFrame(3), MarkFrame(Mark.BAD), NoteFrame(3, "<script>x</script>"), ShowFrame(5), MarkFrame(Mark.GOOD))
    assert "&lt;script&gt;x" in choose(app, Which.BAD)
    assert "<script" not in choose(app, Which.BAD)
    assert "Frame 5" in choose(app, Which.GOOD)
    assert "Frame 5" not in choose(app, Which.BAD)
    assert "Frame 15" in choose(app, Which.NO_POSE)
    rows = app.data.errors("walk", app.data.poses_key("walk", app.store.state.annotation)).position_m
    good, bad = (f"mean error {100 * rows[frame]:.1f} cm" for frame in (5, 3))
    assert f"1 good ({good}), 1 bad ({bad}), 0 unsure" in panel(app)._summary.content
