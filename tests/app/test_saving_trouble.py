"""Files that are damaged, replaced or gone, folders that move, full disks: said in a sentence, nothing lost."""

import errno
import os
import time

import pytest
from gazeloc_app.actions.history import Undo
from gazeloc_app.actions.marks import MarkFrame
from gazeloc_app.actions.picks import PickPoint, Side
from gazeloc_app.actions.views import ShowLayer
from gazeloc_app.annotation.history import read_lines
from gazeloc_app.people.view_memory import View, ViewMemory
from gazeloc_app.state import Layer, Level
from saved_life import Life, new_project

from gazeloc_core.frames.marks import Mark
from gazeloc_core.keypoints import KeypointSet
from gazeloc_core.storage.journal import Journal

FIRST, SECOND = PickPoint(Side.SCAN, (1.0, 2.0, 3.0)), PickPoint(Side.SCAN, (4.0, 5.0, 6.0))


@pytest.fixture
def life(tmp_path):
    """A step of each kind was taken."""
    return Life(new_project(tmp_path)).act(FIRST).act(MarkFrame(Mark.BAD)).act(ShowLayer(Layer.SCAN, False))


def asides(folder, pattern):
    return sorted(path.name.rsplit(".", 1)[0] for path in folder.rglob(pattern))


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("annotations/walk.json", '{"broken'),
        ("annotations/walk.json", "[" * 100_000),
        ("annotations/marks/walk.json", "[7]"),
        ("layers.json", '{"format": "gazeloc-layers", "version": 1, "layers": {"shown": 7}}'),
        ("layers.json", ""),
    ],
)
def test_what_a_damaged_file_said_is_taken_from_the_history_and_written_anew(life, name, content):
    project, history = life.project, life.history
    (project.folder / name).write_text(content)
    again = Life(project)
    assert again.history == history
    assert "put aside" in again.told[0]
    assert str(project.folder / name) in again.told[0]
    assert [path.read_text() for path in project.folder.rglob("*.damaged-*")] == [content]
    again.act(SECOND)
    assert Life(project).told == []
    assert Life(project).history == again.history


def test_a_history_without_a_whole_line_is_said_and_begins_anew_from_the_files(life):
    life.project.history_path("walk").write_text('{"start"')
    again = Life(life.project)
    assert again.store.state.annotation == life.store.state.annotation
    assert "walk.history.jsonl" in again.told[0]
    assert asides(life.project.folder, "*.damaged-*") == ["walk.history.jsonl"]


def test_a_history_that_lacks_its_end_does_not_bring_back_what_was_before(life):
    path = life.project.history_path("walk")
    lines = path.read_text().splitlines(keepends=True)
    at_first_step = next(i for i, line in enumerate(lines) if "step" in line)
    life.act(SECOND)
    path.write_text("".join(lines[: at_first_step + 1]))  # the mark that the files have it too is lost as well
    again = Life(life.project)
    assert again.store.state.annotation.keypoints == life.store.state.annotation.keypoints
    assert len(again.act(Undo()).store.state.annotation.keypoints) == 1


def test_damaged_files_of_one_second_are_all_kept(life):
    for content in ("one", "two", "three"):
        (life.project.folder / "layers.json").write_text(content)
        life.project.history_path("walk").write_text(content)
        Life(life.project).act(ShowLayer(Layer.GRID, True))
    kept = sorted(path.read_text() for path in life.project.folder.rglob("*.damaged-*"))
    assert kept == sorted(["one", "two", "three"] * 2)


def test_what_others_write_while_the_app_is_open_is_kept_beside_its_own(life):
    project = life.project
    project.save_keypoints("walk", KeypointSet())
    life.act(SECOND)
    assert len(project.keypoints("walk")) == 2
    assert "somebody else changed this file" in life.told[0]
    assert len(life.told) == 1
    assert asides(project.folder, "*.other-*") == ["walk.json"]
    life.act(FIRST)
    assert len(life.told) == 1


@pytest.mark.parametrize("how", ["removed", "cut", "replaced"])
def test_a_history_that_is_no_longer_as_it_was_left_is_written_anew_whole(life, how):
    path = life.project.history_path("walk")
    if how == "cut":
        path.write_bytes(path.read_bytes()[:-30])
    else:
        path.unlink()
    if how == "replaced":
        path.with_name("new").write_text("7\n" * 5000)
        path.with_name("new").rename(path)
    life.act(SECOND)
    assert read_lines(Journal(path).read()).history == life.history
    assert asides(path.parent, "*.damaged-*") == ([] if how == "removed" else ["walk.history.jsonl"])
    assert Life(life.project).history == life.history


def test_a_project_that_is_renamed_while_it_is_open_is_not_made_anew_and_goes_on_once_it_is_back(life, tmp_path):
    folder = life.project.folder
    folder.rename(tmp_path / "renamed")
    memory = ViewMemory(folder)
    memory.put("a" * 24, View((1, 2, 3), (0, 0, 0), (0, 0, 1), 0.9, "Orbit"))
    memory.save()
    life.act(SECOND, ShowLayer(Layer.GRID, True))
    assert life.store.state.notice.level is Level.ERROR
    assert "no longer there" in life.store.state.notice.text
    assert life.saver.has_unsaved
    assert not folder.exists()
    (tmp_path / "renamed").rename(folder)
    life.store.save_again()
    memory.save()
    assert not life.saver.has_unsaved
    assert Life(life.project).history == life.history
    assert ViewMemory(folder).get("a" * 24) is not None


def test_what_could_not_be_saved_is_saved_by_itself_once_there_is_room(life, monkeypatch):
    store, seen = life.store, []
    store._save_again_s = 0.02
    store.add_view(lambda state: seen.append("" if state.notice is None else state.notice.text))
    with monkeypatch.context() as patched:
        patched.setattr(os, "write", _full)
        store.start()
        store.dispatch(SECOND)
        _until(lambda: "could not be saved" in seen[-1])
        time.sleep(0.1)
        assert "could not be saved" in seen[-1]
        assert life.saver.has_unsaved
    _until(lambda: seen[-1] == "Your last changes are saved now.")
    store.stop()
    assert Life(life.project).history == life.history


def test_what_could_not_be_saved_is_tried_once_more_at_the_end(life, monkeypatch):
    with monkeypatch.context() as patched:
        patched.setattr(os, "write", _full)
        life.act(SECOND)
        assert life.saver.has_unsaved
    life.store.start()
    life.store.stop()
    assert Life(life.project).history == life.history


def _full(*_):
    raise OSError(errno.ENOSPC, "No space left on device")


def _until(is_so):
    end = time.monotonic() + 5
    while not is_so():
        assert time.monotonic() < end
        time.sleep(0.01)
