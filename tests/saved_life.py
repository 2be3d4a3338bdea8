"""The app's store and savers without the rest of the app, on a project that needs nothing of what it is made of."""

from __future__ import annotations

from pathlib import Path

from any_action import RECORDINGS
from gazeloc_app.actions.choices import OpenRecording
from gazeloc_app.annotation.history import History
from gazeloc_app.annotation.room_saving import RoomSaver
from gazeloc_app.annotation.saving import Saver
from gazeloc_app.state import AppState
from gazeloc_app.store import Store

from gazeloc_core.project import Project, RecordingEntry, ScanEntry, Settings


class Life:
    """The app's store and savers on a project, in the app's order, from a start on."""

    def __init__(self, project: Project):
        self.project, self.told = project, []
        self.saver, self.room = Saver(project, self.told.append), RoomSaver(project.folder, self.told.append)
        history = self.saver.open("walk")
        room = self.saver.room_after_a_kill(self.room.read(history.present))
        self.store = Store(history.with_room_of(room).put_into(AppState(RECORDINGS, "walk")))
        self.writers = (self.saver.commit, self.room.save, self.saver.settle)
        for saver in self.writers[:2]:
            self.store.add_saver(saver)
        self.store.add_effect(self.saver.settle)

    @property
    def history(self) -> History:
        return History.of(self.store.state)

    def act(self, *done):
        for action in done:
            self.store.dispatch(action)
        self.store.step()
        return self

    def open(self, recording: str):
        return self.act(OpenRecording(recording, lambda: self.saver.open(recording)))


def new_project(folder: Path) -> Project:
    """Nothing that it is made of is there: what people decide needs none of it."""
    entry = RecordingEntry(path=folder / "recording")
    scan = ScanEntry(path=folder / "scan.ply", unit="m", up_axis="z")
    return Project.create(folder / "project", Settings(scan=scan, recordings=dict.fromkeys(RECORDINGS, entry)))
