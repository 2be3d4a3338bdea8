"""Saved before shown: what a view has rendered is on the disk, and a start after any crash gives it back."""

import errno
import os
from pathlib import Path

import pytest
from fake_project import make_project
from gazeloc_app.actions.choices import ChooseMethod, OpenRecording
from gazeloc_app.actions.history import Redo, Undo
from gazeloc_app.actions.picks import PickPoint, Side
from gazeloc_app.annotation import saving
from gazeloc_app.annotation.history import History, read_lines
from gazeloc_app.annotation.project_files import annotation_in_files
from gazeloc_app.annotation.saving import Saver
from gazeloc_app.state import AppState, Level
from gazeloc_app.store import Store

from gazeloc_core.keypoints import KeypointSet
from gazeloc_core.methods import Method
from gazeloc_core.project import Project
from gazeloc_core.storage.journal import Journal


@pytest.fixture(scope="module")
def template(tmp_path_factory):
    return make_project(tmp_path_factory.mktemp("home"))


@pytest.fixture
def project(template, tmp_path):
    """Two recordings, which nobody has touched yet; the files they are made of are not looked at."""
    settings = template.settings
    names = ("walk", "sit")
    return Project.create(
        tmp_path / "p",
        settings.__class__(scan=settings.scan, recordings=dict.fromkeys(names, settings.recordings["walk"])),
    )


def started(project: Project, *, settles: bool = True, told: list[str] | None = None) -> Store:
    """The app's loop on a project, as after a start; without `settles` as if killed after each rendering."""
    saver = Saver(project, (told if told is not None else []).append)
    store = Store(saver.open("walk").put_into(AppState(("walk", "sit"), "walk")))
    store.saver = saver  # type: ignore[attr-defined]
    store.add_saver(saver.commit)
    if settles:
        store.add_effect(saver.settle)
    return store


def step(store, *actions):
    for action in actions:
        store.dispatch(action)
    store.step()


def on_disk(project: Project, name: str = "walk") -> History:
    return read_lines(Journal(project.history_path(name)).read())[0]


def test_when_views_render_the_step_is_on_the_disk_already(project):
    store, seen = started(project), []
    store.add_view(lambda state: seen.append(on_disk(project) == History.of(state)))
    for action in (PickPoint(Side.SCAN, (1, 2, 3)), PickPoint(Side.SFM, (1, 2, 3)), Undo(), Redo(), Undo()):
        step(store, action)
    assert seen == [True] * 5


@pytest.mark.parametrize("settles", [True, False])
def test_a_start_after_a_kill_has_the_same_steps_and_the_files_follow(project, settles):
    store = started(project, settles=settles)
    step(store, PickPoint(Side.SCAN, (1, 2, 3)), PickPoint(Side.SCAN, (4, 5, 6)), ChooseMethod(Method.TAGS), Undo())
    again = started(project)
    assert History.of(again.state) == History.of(store.state)
    step(again, Undo())
    assert annotation_in_files(project, "walk") == again.state.annotation
    assert len(project.keypoints("walk")) == 1
    step(again, Redo(), Redo())
    assert again.state.annotation.method is Method.TAGS


def test_what_was_committed_but_not_in_the_files_is_put_there_by_the_next_start(project):
    step(started(project, settles=False), PickPoint(Side.SCAN, (1, 2, 3)))
    assert len(project.keypoints("walk")) == 0
    saver = Saver(project)
    assert saver.has_unsaved is False
    saver.open("walk")
    assert saver.has_unsaved
    saver.settle(*[AppState(("walk",), "walk")] * 2)
    assert len(project.keypoints("walk")) == 1
    assert not saver.has_unsaved


def test_what_others_changed_in_the_files_meanwhile_is_a_step_that_can_be_undone(project):
    store = started(project)
    step(store, PickPoint(Side.SCAN, (1, 2, 3)))
    project.save_keypoints("walk", KeypointSet())
    again = started(project)
    assert len(again.state.annotation.keypoints) == 0
    step(again, Undo())
    assert len(again.state.annotation.keypoints) == 1
    assert len(project.keypoints("walk")) == 1
    assert History.of(started(project).state) == History.of(again.state)


def test_a_full_disk_is_said_at_every_action_and_nothing_is_lost_once_there_is_room(project, monkeypatch):
    store = started(project)
    step(store, PickPoint(Side.SCAN, (1, 2, 3)))
    with monkeypatch.context() as patched:

        def full(*_):
            raise OSError(errno.ENOSPC, "No space left on device")

        patched.setattr(os, "write", full)
        for _ in range(2):
            step(store, PickPoint(Side.SCAN, (4, 5, 6)))
            assert store.state.notice is not None
            assert store.state.notice.level is Level.ERROR
            assert "could not be saved (No space left on device)" in store.state.notice.text
        step(store, OpenRecording("sit", lambda: store.saver.open("sit")), PickPoint(Side.SCAN, (7, 8, 9)))
        assert store.saver.has_unsaved
        assert len(on_disk(project).present.keypoints) == 1
    step(store, PickPoint(Side.SCAN, (7, 8, 10)))
    assert [len(project.keypoints(name)) for name in ("walk", "sit")] == [3, 2]
    assert not store.saver.has_unsaved
    assert len(on_disk(project, "sit").annotations) == 3


def test_opening_another_recording_and_coming_back_keeps_each_history(project):
    store = started(project)
    go = {name: OpenRecording(name, lambda name=name: store.saver.open(name)) for name in ("walk", "sit")}
    step(store, PickPoint(Side.SCAN, (1, 2, 3)), go["sit"], PickPoint(Side.SCAN, (4, 5, 6)), go["walk"], go["sit"])
    step(store, go["walk"])
    assert [pair.scan for pair in store.state.annotation.keypoints] == [(1, 2, 3)]
    step(store, Undo())
    assert len(project.keypoints("walk")) == 0
    assert [pair.scan for pair in project.keypoints("sit")] == [(4, 5, 6)]


def test_a_damaged_history_is_put_aside_and_the_keypoints_stay(project):
    step(started(project), PickPoint(Side.SCAN, (1, 2, 3)))
    path = project.history_path("walk")
    path.write_text("garbled\n" + path.read_text())
    told: list[str] = []
    store = started(project, told=told)
    assert len(store.state.annotation.keypoints) == 1
    assert store.state.past == ()
    assert len(told) == 1
    assert "put aside" in told[0]
    step(store, PickPoint(Side.SCAN, (4, 5, 6)))
    assert len(started(project).state.past) == 1
    assert len(list(Path(path.parent).glob("*.damaged-*"))) == 1


def test_a_long_history_is_written_anew_and_stays_whole(project, monkeypatch):
    monkeypatch.setattr(saving, "MAX_LINES", 20)
    store = started(project)
    for i in range(60):
        step(store, PickPoint(Side.SCAN, (i, 2, 3)) if i % 3 else Undo())
    assert len(Journal(project.history_path("walk")).read()) < 90
    assert History.of(started(project).state) == History.of(store.state)
