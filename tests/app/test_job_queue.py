"""Jobs that wait: in order, each can be taken off; and what was under way is offered after a start, never begun."""

import json
from pathlib import Path

import pytest
from app_project import make_app_project
from app_steps import step, stop
from fake_project import make_project
from gazeloc_app.actions.jobs import (
    MAX_WAITING,
    CancelJob,
    DismissJobs,
    JobEnded,
    JobProgressed,
    OfferJobs,
    ResumeJobs,
    StartJob,
)
from gazeloc_app.app import App
from gazeloc_app.panels.jobs import JobBar
from gazeloc_app.state import AppState, Level
from gazeloc_app.store import Store
from gazeloc_app.work import job_list, tasks
from gazeloc_app.work.job_list import JobList

from gazeloc_core.methods import Method

WALK = (("recording", "walk"),)
ALIGN = StartJob("Align", tasks.align, WALK)
RUN = StartJob("Run tags", tasks.run_all, (*WALK, ("method", Method.TAGS)))
ROOT = Path("/srv/exports")
"""Where exports go; nothing is written there in these tests."""
EXPORT = StartJob("Export", tasks.export, (*WALK, ("formats", ("csv", "tum")), ("output", str(ROOT / "out"))))


def apply(state, *actions):
    for action in actions:
        state = action.apply(state)
    return state


def fresh():
    return AppState(("walk",), "walk")


def names(state):
    return [job.name for job in state.jobs]


def test_jobs_wait_in_the_order_in_which_they_were_asked_for():
    state = apply(fresh(), ALIGN, RUN, EXPORT)
    assert names(state) == ["Align", "Run tags", "Export"]
    assert state.notice.text == "“Export” begins after “Run tags”."
    state = apply(state, JobProgressed(0.5, "half", "", "12:00 half"), JobEnded(Level.WARNING, "It fits badly."))
    assert names(state) == ["Run tags", "Export"]
    assert [job.number for job in state.jobs] == [2, 3]
    (ended,) = state.ended_jobs
    assert (ended.name, ended.notice.text, ended.log) == ("Align", "It fits badly.", ("12:00 half",))


def test_the_same_work_is_not_queued_twice_and_the_queue_has_an_end():
    state = apply(fresh(), ALIGN, ALIGN, StartJob("By another name", tasks.align, WALK))
    assert names(state) == ["Align"]
    many = [StartJob(f"Refine {i}", tasks.refine, (*WALK, ("start", str(i)))) for i in range(MAX_WAITING + 5)]
    assert len(apply(state, *many).waiting_jobs) == MAX_WAITING


def test_each_job_can_be_cancelled_by_its_number():
    state = apply(fresh(), ALIGN, RUN, EXPORT, CancelJob(2))
    assert names(state) == ["Align", "Export"]
    assert not state.job.is_cancelling
    state = apply(state, CancelJob(1), CancelJob(99))
    assert state.job.is_cancelling
    state = apply(state, JobEnded(Level.INFO, "cancelled"), CancelJob(1))
    assert names(state) == ["Export"]
    assert not state.job.is_cancelling


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    return make_project(tmp_path_factory.mktemp("home"))


@pytest.fixture
def told():
    return []


@pytest.fixture
def kept(project, told):
    (project.folder / "jobs.json").unlink(missing_ok=True)
    return JobList(project, ROOT, told.append)


def test_what_was_under_way_is_offered_as_it_was_asked_for_and_not_begun(kept):
    kept.save(fresh(), apply(fresh(), RUN, EXPORT, StartJob("Colour the scan", tasks.color_scan)))
    offered = kept.read()
    state = apply(fresh(), OfferJobs(offered))
    assert state.job is None
    resumed = apply(state, ResumeJobs())
    assert [(job.name, job.task, job.keywords) for job in resumed.jobs] == [
        (job.name, job.task, job.keywords) for job in (RUN, EXPORT)
    ]
    assert isinstance(dict(resumed.job.keywords)["method"], Method)
    assert resumed.offered_jobs == ()


def test_the_list_is_on_the_disk_before_a_job_is_shown_and_empty_when_all_have_ended(kept, project):
    store, seen = Store(fresh()), []
    store.add_saver(kept.save)
    store.add_view(lambda state: seen.append(len(kept.read()) == len(state.jobs)))
    for action in (RUN, EXPORT, CancelJob(2), JobEnded(Level.INFO, "done")):
        store.dispatch(action)
        store.step()
    assert seen == [True] * 4
    assert kept.read() == ()


def test_an_offer_stands_until_it_is_taken_or_dismissed_whatever_else_runs(kept):
    kept.save(fresh(), apply(fresh(), RUN, EXPORT))
    state = apply(fresh(), OfferJobs(kept.read()), ALIGN)
    kept.save(fresh(), state)
    assert [job.name for job in kept.read()] == ["Run tags", "Export", "Align"]
    state = apply(state, RUN)
    assert [job.name for job in state.offered_jobs] == ["Export"]
    kept.save(state, apply(state, DismissJobs(), CancelJob(2), JobEnded(Level.INFO, "done")))
    assert kept.read() == ()


@pytest.mark.parametrize(
    "entry",
    [
        {"name": "x", "task": "Project", "keywords": {"recording": "walk"}},
        {"name": "x", "task": "pipeline", "keywords": {"recording": "walk"}},
        {"name": "x", "task": "part", "keywords": {"recording": "walk"}},
        {"name": "x", "task": "__builtins__", "keywords": {}},
        {"name": "x", "task": "align", "keywords": {"recording": "gone"}},
    ],
)
def test_only_our_own_tasks_on_our_own_recordings_are_offered(kept, project, told, entry):
    (project.folder / "jobs.json").write_text(json.dumps({"version": job_list.VERSION, "jobs": [entry]}))
    assert kept.read() == ()
    assert told == []


@pytest.mark.parametrize(
    "text",
    [
        "{",
        "[]",
        '{"jobs": [3]}',
        '{"jobs": [{"name": "x", "task": "align", "keywords": {"recording": "walk", "shell": "rm"}}]}',
        '{"jobs": [{"name": "x", "task": "run_all", "keywords": {"recording": "walk", "method": "magic"}}]}',
    ],
)
def test_a_damaged_list_is_said_and_offers_nothing(kept, project, told, text):
    (project.folder / "jobs.json").write_text(text)
    assert kept.read() == ()
    assert len(told) == 1
    assert "jobs.json" in told[0]


@pytest.mark.parametrize(
    ("task", "keywords", "named"),
    [
        ("export", {"formats": ["csv"], "output": "/etc"}, "/etc"),
        ("export", {"formats": ["csv"], "output": "out"}, "out"),
        ("export", {"formats": ["csv"], "output": "/srv/exports/../../etc/cron.d"}, ".."),
        ("export", {"formats": ["csv"], "output": "/srv/exports/~root"}, "~root"),
        ("export", {"formats": ["csv"], "output": "/srv/exports/a\nb"}, "a"),
        ("export", {"formats": ["csv"], "output": "/srv/exports-too/x"}, "exports-too"),
        ("export", {"formats": ["csv"], "output": ["/srv/exports"]}, "output"),
        ("export", {"formats": ["csv"], "output": None}, "output"),
        ("export", {"formats": ["exe"], "output": "/srv/exports"}, "exe"),
        ("export", {"formats": [], "output": "/srv/exports"}, "formats"),
        ("export", {"formats": "csv", "output": "/srv/exports"}, "formats"),
        ("export", {"formats": [["csv"]], "output": "/srv/exports"}, "formats"),
        ("export", {"formats": ["csv"]}, "output"),
        ("refine", {"start": "../../../secrets"}, "secrets"),
        ("refine", {"start": 7}, "start"),
        ("refine", {"start": ""}, "alignment"),
        ("run_all", {"method": ["sfm"]}, "sfm"),
        ("run_all", {"method": 3}, "3"),
    ],
)
def test_every_value_of_a_job_is_checked_on_the_way_back(kept, project, told, task, keywords, named):
    entry = {"name": "x", "task": task, "keywords": {"recording": "walk", **keywords}}
    (project.folder / "jobs.json").write_text(json.dumps({"version": job_list.VERSION, "jobs": [entry]}))
    assert kept.read() == ()
    assert len(told) == 1
    assert "jobs.json" in told[0]
    assert named in told[0]


@pytest.mark.parametrize("recording", [3, None, ["walk"], {"walk": 1}])
def test_a_recording_that_is_no_text_is_no_recording(kept, project, recording):
    entry = {"name": "x", "task": "align", "keywords": {"recording": recording}}
    (project.folder / "jobs.json").write_text(json.dumps({"version": job_list.VERSION, "jobs": [entry]}))
    assert kept.read() == ()


def test_an_export_does_not_go_on_through_a_link_that_leads_out(tmp_path, project, told):
    root = tmp_path / "export"
    root.mkdir()
    (root / "link").symlink_to("/etc")
    keywords = {"recording": "walk", "formats": ["csv"], "output": str(root / "link")}
    entry = {"name": "x", "task": "export", "keywords": keywords}
    (project.folder / "jobs.json").write_text(json.dumps({"version": job_list.VERSION, "jobs": [entry]}))
    assert JobList(project, root, told.append).read() == ()
    assert "leads out" in told[0]


def test_a_start_after_a_kill_offers_what_ran_and_begins_it_only_when_somebody_says_so(tmp_path, monkeypatch):
    project = make_app_project(tmp_path)
    output = str(project.folder / "export" / "out")
    export = StartJob("Export", tasks.export, (*WALK, ("formats", ("csv",)), ("output", output)))
    JobList(project, ROOT, print).save(fresh(), apply(fresh(), ALIGN, export))
    app = App(project, port=0)
    begun = []
    monkeypatch.setattr(app.jobs, "start", lambda name, task, **keywords: begun.append((name, keywords)))
    bar = next(view.__self__ for view in app.store._views if isinstance(getattr(view, "__self__", None), JobBar))
    step(app)
    assert bar._resume.visible
    assert bar._resume.label == "Go on with 2 jobs"
    assert "ended while it worked on “Align”, “Export”" in bar._offer.content
    assert begun == []
    step(app, ResumeJobs())
    assert begun == [("Align", {"recording": "walk"})]
    assert names(app.store.state) == ["Align", "Export"]
    assert not bar._resume.visible
    stop(app)
    again = App(project, port=0)
    step(again, DismissJobs())
    stop(again)
    assert JobList(project, ROOT, print).read() == ()
