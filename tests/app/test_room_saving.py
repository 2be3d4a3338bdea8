"""A kill between any two of the writes of one step: what is about the room is as it was, or as it was wanted, whole."""

from dataclasses import replace

import pytest
from app_project import make_app_project
from gazeloc_app.actions.history import Redo, Undo
from gazeloc_app.actions.places import RemoveView, SaveView
from gazeloc_app.actions.views import ShowLayer, TintLayer
from gazeloc_app.annotation.history import History
from gazeloc_app.annotation.room_saving import RoomSaver
from gazeloc_app.annotation.saving import Saver
from gazeloc_app.state import ABOUT_THE_ROOM, AppState, Layer

from gazeloc_core.surfaces.saved_views import SavedView

NAMES = ("walk", "sit")
CORNER = SavedView("corner", (1.0, 1.0, 1.0), (2.0, 1.0, 1.0))


class Life:
    """The app's savers in the app's order, from its start on."""

    def __init__(self, project):
        self.saver, self.room = Saver(project), RoomSaver(project.folder)
        room = self.saver.room_after_a_kill(self.room.read())
        self.state = self.saver.open("walk").with_room_of(room).put_into(AppState(NAMES, "walk"))

    def act(self, action, writes=3):
        """Apply an action; the kill comes after so many of its writes."""
        before, self.state = self.state, action.apply(self.state)
        for write in (self.saver.commit, self.room.save, self.saver.settle)[:writes]:
            write(before, self.state)
        return self

    def open(self, name):
        self.state = self.saver.open(name).with_room_of(self.state.annotation).put_into(AppState(NAMES, name))
        return self


@pytest.fixture
def project(tmp_path):
    return make_app_project(tmp_path, recordings=NAMES)


@pytest.mark.parametrize("writes", [0, 1, 2, 3])
@pytest.mark.parametrize(
    "last",
    [SaveView(CORNER), RemoveView("old"), Undo(), TintLayer(Layer.SCAN, (1, 2, 3)), ShowLayer(Layer.SCAN, False)],
)
def test_one_step_is_whole_or_not_at_all(project, last, writes):
    old = replace(CORNER, name="old")
    life = Life(project).act(TintLayer(Layer.SCAN, (9, 9, 9))).act(SaveView(old))
    before = History.of(life.state)
    after = History.of(life.act(last, writes).state)
    again = Life(project)
    assert History.of(again.state) == (after if writes else before)
    again.act(Redo())
    assert Life(project).state.annotation == again.state.annotation
    room = RoomSaver(project.folder).read()
    for name in ABOUT_THE_ROOM:
        assert getattr(room, name) == getattr(again.state.annotation, name)


@pytest.mark.parametrize("writes", [1, 2, 3])
def test_a_kill_in_one_recording_is_mended_although_the_start_opens_another(project, writes):
    life = Life(project).open("sit").act(SaveView(CORNER), writes)
    wanted = History.of(life.state)
    again = Life(project)
    assert (again.state.recording, again.state.annotation.views) == ("walk", (CORNER,))
    later = replace(CORNER, name="later")
    again.act(SaveView(later))
    assert again.open("sit").state.annotation.views == (CORNER, later)
    assert len(History.of(again.state).annotations) == len(wanted.annotations)
    assert Life(project).state.annotation.views == (CORNER, later)


def test_a_journal_that_ends_in_half_a_line_or_in_a_long_one_is_known_as_unsettled(project):
    life = Life(project).act(SaveView(CORNER))
    path = project.history_path("walk")
    whole = path.read_bytes()
    path.write_bytes(whole + b'{"step": {"vie')
    assert Life(project).state.annotation.views == (CORNER,)
    path.write_bytes(whole)
    many = [replace(CORNER, name=f"view {i}") for i in range(20)]
    for view in many:
        life = Life(project).act(SaveView(view), writes=1)
    assert Life(project).state.annotation.views == (CORNER, *many) == life.state.annotation.views
