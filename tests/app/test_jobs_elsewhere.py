"""Another recording is looked at while a job is about the first: the job's end disturbs nothing that is shown."""

import asyncio
import threading
import time
from types import SimpleNamespace

import pytest
from app_project import make_app_project
from app_steps import step, stop
from gazeloc_app.actions.choices import ChooseAlignment
from gazeloc_app.actions.history import Undo
from gazeloc_app.actions.jobs import CancelJob, JobEnded, JobProgressed, StartJob
from gazeloc_app.actions.picks import PickPoint, Side
from gazeloc_app.annotation.project_files import annotation_in_files
from gazeloc_app.annotation.saving import Saver
from gazeloc_app.app import App
from gazeloc_app.newest import Newest
from gazeloc_app.panels.alignment import AlignmentPanel
from gazeloc_app.panels.jobs import JobBar, JobLogs
from gazeloc_app.panels.project import ProjectPanel
from gazeloc_app.state import Level
from gazeloc_app.work import tasks
from viser import _messages

from gazeloc_core import pipeline
from gazeloc_core.project import Project

ALIGN = {name: StartJob("Align", tasks.align, (("recording", name),)) for name in ("walk", "sit")}
CLICK = PickPoint(Side.SCAN, (1, 1, 0))
KEY = "c0ffee"


@pytest.fixture
def project(tmp_path):
    return make_app_project(tmp_path, recordings=("walk", "sit"))


@pytest.fixture
def begun(app, monkeypatch):
    """Names of the recordings that jobs were begun for; none does anything."""
    found = []
    monkeypatch.setattr(app.jobs, "start", lambda name, task, **keywords: found.append(keywords["recording"]))
    return found


def open_recording(app, name, *actions):
    app._open_recording(name)
    step(app, *actions)


def ended(by_person=True):
    return JobEnded(Level.INFO, "Aligned.", alignment=KEY, by_person=by_person)


def after_a_restart(project, name):
    """What the next life of the app would show of a recording."""
    with Project.open(project.folder).lock():
        return Saver(project).open(name)


def test_another_recording_is_opened_and_annotated_while_the_job_goes_on(app, begun):
    step(app, ALIGN["walk"])
    open_recording(app, "sit", CLICK, JobProgressed(0.4, "fitting"))
    state = app.store.state
    assert (state.recording, state.job.recording, state.job.fraction) == ("sit", "walk", 0.4)
    assert len(state.annotation.keypoints) == 1
    assert begun == ["walk"]
    assert "Align (walk) · fitting" in app.panels.of(JobBar)._text.content


def test_its_end_says_whose_it_was_and_changes_nothing_that_is_shown(app, begun):
    step(app, ALIGN["walk"])
    open_recording(app, "sit", CLICK)
    before = app.store.state
    step(app, ended())
    after = app.store.state
    assert (after.recording, after.annotation, after.past, after.frame) == (
        before.recording,
        before.annotation,
        before.past,
        before.frame,
    )
    assert after.notice.text == "walk: Aligned."
    assert "Align (walk)" in app.panels.of(JobLogs)._ended.content


def test_its_alignment_is_a_step_of_the_recording_that_it_was_about(app, begun):
    step(app, ALIGN["walk"])
    open_recording(app, "sit")
    step(app, ended())
    open_recording(app, "walk")
    assert app.store.state.annotation.alignment == KEY
    assert app.store.state.annotation.alignment_by_person
    assert app.store.state.suggested == ()
    step(app, Undo())
    assert app.store.state.annotation.alignment is None
    open_recording(app, "sit")
    open_recording(app, "walk")
    assert app.store.state.annotation.alignment is None


def test_it_is_on_the_disk_once_it_was_said(app, begun, project):
    step(app, CLICK, ALIGN["walk"])
    open_recording(app, "sit")
    app.store.add_view(lambda state: seen.append(Saver(project).open("walk").present.alignment))
    seen = []
    step(app, ended())
    assert seen == [KEY]
    chosen = project.settings.chosen["walk"]
    assert (chosen.alignment, chosen.by_person) == (KEY, True)
    stop(app)
    history = after_a_restart(project, "walk")
    assert history.present == annotation_in_files(project, "walk")
    assert [len(annotation.keypoints) for annotation in history.annotations] == [0, 1, 1]


def test_a_run_never_replaces_what_a_person_chose_there(app, begun, project):
    step(app, ALIGN["walk"], ChooseAlignment("abcd"))
    open_recording(app, "sit")
    step(app, ended(by_person=False))
    open_recording(app, "walk")
    assert app.store.state.annotation.alignment == "abcd"


@pytest.mark.parametrize("order", ["ended first", "opened first"])
def test_it_ends_in_the_very_step_in_which_its_recording_is_opened(app, begun, project, order):
    step(app, ALIGN["walk"])
    open_recording(app, "sit", CLICK)
    if order == "ended first":
        app.store.dispatch(ended())
        app._open_recording("walk")
    else:
        app._open_recording("walk")
        app.store.dispatch(ended())
    step(app)
    assert (app.store.state.recording, app.store.state.annotation.alignment) == ("walk", KEY)
    step(app, Undo())
    assert app.store.state.annotation.alignment is None
    assert Saver(project).open("walk").present.alignment is None
    assert len(Saver(project).open("sit").present.keypoints) == 1


def test_a_recording_that_was_not_open_yet_gets_its_step_too(app, begun, project):
    step(app, ALIGN["sit"], ended())
    assert app.store.state.annotation.alignment is None
    assert Saver(project).open("sit").present.alignment == KEY
    open_recording(app, "sit")
    assert app.store.state.annotation.alignment == KEY


def test_the_same_work_on_another_recording_waits_and_can_be_taken_off(app, begun):
    step(app, ALIGN["walk"])
    open_recording(app, "sit")
    button = app.panels.of(AlignmentPanel)._align
    assert not button.disabled
    step(app, ALIGN["sit"])
    assert button.disabled
    assert app.store.state.notice.text == "“Align” begins after “Align (walk)”."
    step(app, CancelJob(2))
    assert [job.recording for job in app.store.state.jobs] == ["walk"]
    step(app, ALIGN["sit"], JobEnded(Level.INFO, "done"))
    assert begun == ["walk", "sit"]


def test_what_is_offered_after_a_start_may_be_about_any_recording(project):
    app = App(project, port=0)
    step(app, ALIGN["sit"])
    stop(app)
    again = App(project, port=0)
    again.store._render()
    step(again)
    assert "“Align (sit)”" in again.panels.of(JobBar)._offer.content
    stop(again)


class TestTheTableOfStages:
    def table(self, app):
        panel = app.panels.of(ProjectPanel)
        assert panel.wait()
        return panel._stages.content

    def test_it_says_what_runs_and_is_made_anew_when_a_stage_ends_in_the_middle_of_a_job(self, app, begun, project):
        step(app, ALIGN["walk"], JobProgressed(0.1, "Align to the scan: fitting"))
        table = self.table(app)
        assert "running" in table
        artifact = project.artifact("walk", "alignment")
        inputs = pipeline.stage_named("alignment").inputs(project, "walk")
        artifact.write(lambda folder: None, options={}, inputs=inputs)
        step(app, JobProgressed(0.2, "Refine with ICP: icp"))
        assert self.table(app).count(">done<") == table.count(">done<") + 1

    def test_a_job_about_another_recording_runs_none_of_its_stages(self, app, begun):
        step(app, ALIGN["sit"], JobProgressed(0.1, "Align to the scan: fitting"))
        assert "running" not in self.table(app)

    def test_nothing_is_looked_up_while_a_stage_gets_on(self, app, begun, monkeypatch):
        looked = []
        step(app, ALIGN["walk"], JobProgressed(0.1, "Align to the scan: fitting"))
        self.table(app)
        monkeypatch.setattr(pipeline, "statuses", lambda *_: looked.append(1))
        step(app, JobProgressed(0.2, "Align to the scan: fitting still"))
        self.table(app)
        assert looked == []

    def test_opening_a_recording_does_not_wait_for_its_files_to_be_read(self, app, monkeypatch):
        self.table(app)
        gate, plain = threading.Event(), pipeline.statuses
        monkeypatch.setattr(pipeline, "statuses", lambda *parts: [gate.wait(20), plain(*parts)][1])
        open_recording(app, "sit", CLICK)
        assert len(app.store.state.annotation.keypoints) == 1
        assert "Looking through the files of sit" in app.panels.of(ProjectPanel)._stages.content
        gate.set()
        assert "Choose keyframes" in self.table(app)


def test_choosing_a_recording_that_is_slow_to_read_holds_no_page_up(app, monkeypatch):
    gate, plain = threading.Event(), app.data.recording
    monkeypatch.setattr(app.data, "recording", lambda name: [gate.wait(20), plain(name)][1])
    dropdown = app.panels.of(ProjectPanel)._recording
    app.server.gui._resolve_client = lambda client_id: SimpleNamespace(client_id=client_id)
    message = _messages.GuiUpdateMessage(dropdown._impl.uuid, {"value": "sit"})
    begun_s = time.monotonic()
    asyncio.run(app.server.gui._handle_gui_updates(7, message))
    assert time.monotonic() - begun_s < 5
    app.store.step()
    assert app.store.state.recording == "walk"
    gate.set()
    end_s = time.monotonic() + 20
    while app.store.state.recording != "sit":
        assert time.monotonic() < end_s
        time.sleep(0.02)
        app.store.step()


class TestWorkForTheNewestWish:
    def test_older_wishes_that_were_not_begun_are_dropped(self):
        gate, done = threading.Event(), []

        def work(wish):
            gate.wait(10)
            done.append((wish, newest.is_newest(wish)))

        newest = Newest(work, "test")
        newest.ask(0)
        time.sleep(0.1)  # the first is begun
        for wish in range(1, 50):
            newest.ask(wish)
        gate.set()
        assert newest.wait(10)
        assert done == [(0, False), (49, True)]

    def test_one_that_fails_does_not_end_the_others(self):
        done = []
        newest = Newest(lambda wish: done.append(1 / wish), "test")
        newest.ask(0)
        assert newest.wait(10)
        newest.ask(2)
        assert newest.wait(10)
        assert done == [0.5]


def test_what_is_unfolded_of_ended_jobs_is_not_made_anew_while_another_reports(app, begun):
    step(app, ALIGN["walk"], JobEnded(Level.INFO, "done"), ALIGN["walk"])
    logs = app.panels.of(JobLogs)
    ended = logs._ended.content
    step(app, JobProgressed(0.1, "fitting", "", "12:00 fitting"))
    assert "12:00 fitting" in logs._running.content
    assert logs._ended.content == ended
