"""Whatever happens to a project while people work, nothing is lost: kills, full disks, damaged and moved files."""

import errno
import os
import shutil
import tempfile
from contextlib import contextmanager
from pathlib import Path
from unittest import mock

from any_action import RECORDINGS, actions
from gazeloc_app.actions.picks import PickPoint, Side
from gazeloc_app.annotation.history import History, read_lines
from gazeloc_app.annotation.project_files import FIELDS, annotation_in_files
from gazeloc_app.annotation.room_saving import RoomSaver
from gazeloc_app.state import ABOUT_THE_ROOM, AppState, Level
from hypothesis import Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule
from saved_life import Life, new_project

from gazeloc_core.storage.journal import Journal


@contextmanager
def full_disk():
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    with mock.patch.object(os, "write", full), mock.patch.object(os, "fsync", full):
        yield


def decided(annotation) -> list:
    return [getattr(annotation, name) for name in FIELDS]


def broken(path: Path, kind: str, at: float) -> None:
    data = path.read_bytes()
    cut = int(at * len(data))
    path.write_bytes(
        {"cut": data[:cut], "garbage": b"\x00\xff{" + data[:cut], "zeros": data + b"\0" * 512, "empty": b""}[kind]
    )


class Safety(RuleBasedStateMachine):
    life: Life

    @initialize()
    def begin(self):
        self.folder = Path(tempfile.mkdtemp(prefix="gazeloc-safety-"))
        self.life = Life(new_project(self.folder))
        self.is_full = False

    def teardown(self):
        shutil.rmtree(self.folder, ignore_errors=True)

    @rule(done=st.lists(actions(lambda name: CURRENT[0].saver.open(name)), min_size=1, max_size=4))
    def act(self, done):
        CURRENT[:] = [self.life]
        if not self.is_full:
            self.life.act(*done)
            return
        with full_disk():
            self.life.act(*done)
        if self.life.saver.has_unsaved:
            notice = self.life.store.state.notice
            assert notice is not None, "a step that is in memory alone is said to be"
            assert notice.level is Level.ERROR

    @precondition(lambda self: not self.is_full)
    @rule(action=actions(lambda name: CURRENT[0].saver.open(name)), writes=st.integers(0, 3))
    def killed_between_the_writes_of_a_step(self, action, writes):
        CURRENT[:] = [self.life]
        before, after = self.life.store.state, action.apply(self.life.store.state)
        if after.recording != before.recording:
            return
        for write in self.life.writers[:writes]:
            write(before, after)
        self.start(after if writes else before)

    @precondition(lambda self: not self.is_full)
    @rule()
    def killed(self):
        self.start(self.life.store.state)

    @rule()
    def the_disk_is_full(self):
        self.is_full = True

    @precondition(lambda self: self.is_full)
    @rule()
    def there_is_room_again(self):
        self.is_full = False
        self.life.store.save_again()

    @precondition(lambda self: not self.is_full)
    @rule(done=st.lists(actions(lambda name: CURRENT[0].saver.open(name)), min_size=1, max_size=3))
    def the_folder_is_renamed_for_a_while(self, done):
        CURRENT[:] = [self.life]
        project = self.life.project.folder
        project.rename(self.folder / "elsewhere")
        self.life.act(*done)
        assert not project.exists(), "a folder made anew hides that the project is missing"
        if self.life.saver.has_unsaved:
            assert "put it back" in self.life.store.state.notice.text
        (self.folder / "elsewhere").rename(project)
        self.life.store.save_again()

    @precondition(lambda self: not self.is_full)
    @rule(
        name=st.sampled_from(RECORDINGS),
        kind=st.sampled_from(["cut", "garbage", "empty"]),
        at=st.floats(0, 0.9),
    )
    def keypoints_are_damaged_while_they_are_open_and_a_step_follows(self, name, kind, at):
        path = self.life.project.keypoints_path(name)
        if path.exists():
            broken(path, kind, at)
            self.life.open(name).act(PickPoint(Side.SCAN, (1.0, 2.0, 3.0)))

    @precondition(lambda self: not self.is_full)
    @rule(is_cut=st.booleans())
    def the_history_is_cut_or_removed_while_it_is_open_and_a_step_follows(self, is_cut):
        path = self.life.project.history_path(self.life.store.state.recording)
        if path.exists():
            path.write_bytes(path.read_bytes()[:-9]) if is_cut else path.unlink()
            self.life.act(PickPoint(Side.SCAN, (1.0, 2.0, 3.0)))

    @precondition(lambda self: not self.is_full)
    @rule(
        which=st.sampled_from(["keypoints", "marks", "history", "views.json", "colors.json", "layers.json"]),
        kind=st.sampled_from(["cut", "garbage", "zeros", "empty"]),
        at=st.floats(0, 0.99),
    )
    def a_file_is_damaged_between_two_lives(self, which, kind, at):
        project, state, history = self.life.project, self.life.store.state, self.life.history
        paths = {name: getattr(project, f"{name}_path")(state.recording) for name in ("keypoints", "marks", "history")}
        path = paths.get(which, project.folder / which)
        if not path.exists():
            return
        broken(path, kind, at)
        self.life = Life(project).open(state.recording)
        assert any(decided(one) == decided(state.annotation) for one in self.life.history.annotations)
        assert self.life.told or path == paths["history"] or self.life.history == history

    @invariant()
    def what_is_shown_is_on_the_disk(self):
        if self.is_full or self.life.store._is_unsaved:
            return
        state, project = self.life.store.state, self.life.project
        journal = project.history_path(state.recording)
        if not journal.exists():
            return
        assert read_lines(Journal(journal).read()).history == self.life.history
        assert decided(annotation_in_files(project, state.recording)) == decided(state.annotation)
        room = RoomSaver(project.folder).read()
        assert [getattr(room, name) for name in ABOUT_THE_ROOM] == [
            getattr(state.annotation, name) for name in ABOUT_THE_ROOM
        ]

    def start(self, wanted: AppState) -> None:
        """The next life, with the recording open that was; it has the same steps."""
        self.life = Life(self.life.project).open(wanted.recording)
        assert self.life.history == History.of(wanted)


CURRENT: list[Life] = []
TestSafety = Safety.TestCase
TestSafety.settings = settings(max_examples=40, stateful_step_count=25, deadline=None, phases=[Phase.generate])
