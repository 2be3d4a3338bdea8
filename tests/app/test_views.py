"""Saved views: kept with the project, shared by its recordings, removed again; and a camera that goes there."""

from types import SimpleNamespace

import numpy as np
import pytest
from app_project import make_app_project
from app_steps import step, stop
from gazeloc_app.actions.choices import OpenRecording
from gazeloc_app.actions.history import Redo, Undo
from gazeloc_app.actions.picks import PickPoint, Side
from gazeloc_app.actions.places import RemoveView, RenameView, SaveView
from gazeloc_app.actions.views import TintLayer
from gazeloc_app.app import App
from gazeloc_app.panels.views import ViewList
from gazeloc_app.routes import Routes
from gazeloc_app.server import make_server
from gazeloc_app.state import Annotation, AppState, Layer

from gazeloc_core.surfaces.layer_colors import read_layer_colors
from gazeloc_core.surfaces.saved_views import MAX_VIEWS, SavedView, read_views, write_views

DESK, DOOR = SavedView("desk", (1, 2, 3), (0, 0, 1)), SavedView("door", (3, 2, 1), (0, 0, 1))


@pytest.fixture
def project(tmp_path):
    return make_app_project(tmp_path, recordings=("walk", "other"))


def opened(project):
    app = App(project, port=0)
    app.store._render()
    return app


def labels(app):
    handles = app.server.gui._gui_input_handle_from_uuid.values()
    return {handle.label for handle in handles if getattr(handle, "options", None) == ("Go", "Rename", "Remove")}


def test_views_are_on_the_disk_after_the_step_and_there_at_the_next_start(project):
    app = opened(project)
    step(app, SaveView(DESK), SaveView(DOOR))
    assert read_views(project.folder) == (DESK, DOOR)
    assert labels(app) == {"desk", "door"}
    step(app, RemoveView("desk"))
    stop(app)
    app = opened(project)
    try:
        assert app.store.state.annotation.views == (DOOR,)
        assert labels(app) == {"door"}
        step(app, OpenRecording("other", lambda: app._saver.open("other")))
        assert app.store.state.recording == "other"
        assert app.store.state.annotation.views == (DOOR,)
    finally:
        stop(app)


def test_views_and_colours_are_undone_with_everything_else_and_that_is_kept_too(project):
    app = opened(project)
    step(app, SaveView(DESK), TintLayer(Layer.SCAN, (9, 8, 7)), RenameView("desk", "table"), RemoveView("table"))
    for views, tints in ((["table"], True), (["desk"], True), (["desk"], False), ([], False)):
        step(app, Undo())
        assert [view.name for view in app.store.state.annotation.views] == views
        assert [view.name for view in read_views(project.folder)] == views
        assert read_layer_colors(project.folder) == ({"Scan": (9, 8, 7)} if tints else {})
    step(app, Redo(), Redo())
    assert app.scene._room._look[0] == (9, 8, 7)
    stop(app)
    app = opened(project)
    try:
        assert app.store.state.annotation.tint(Layer.SCAN) == (9, 8, 7)
        assert len(app.store.state.past) == 2
        step(app, Undo(), Undo())
        assert read_views(project.folder) == ()
        assert app.scene._room._look[0] == (255, 255, 255)
    finally:
        stop(app)


def test_another_recording_has_the_rooms_views_and_undoing_there_takes_back_what_was_done_there(project):
    app = opened(project)
    try:
        step(app, PickPoint(Side.SCAN, (1, 2, 3)))
        step(app, SaveView(DESK), OpenRecording("other", lambda: app._saver.open("other")))
        assert app.store.state.annotation.views == (DESK,)
        step(app, PickPoint(Side.SCAN, (1, 1, 1)), SaveView(DOOR), Undo(), Undo(), Undo())
        assert app.store.state.annotation == Annotation(views=(DESK,))
        step(app, TintLayer(Layer.SCAN, (1, 2, 3)), OpenRecording("walk", lambda: app._saver.open("walk")))
        assert len(app.store.state.annotation.keypoints) == 1
        assert app.store.state.annotation.tint(Layer.SCAN) == (1, 2, 3)
        step(app, Undo())
        assert app.store.state.annotation.views == ()
        assert app.store.state.annotation.tint(Layer.SCAN) == (1, 2, 3)
    finally:
        stop(app)


def test_a_project_whose_history_knew_no_views_keeps_them_at_every_step(project):
    app = opened(project)
    step(app, PickPoint(Side.SCAN, (1, 2, 3)))
    stop(app)
    write_views(project.folder, (DESK,))
    app = opened(project)
    try:
        step(app, Undo())
        assert app.store.state.annotation.views == (DESK,)
        assert len(app.store.state.annotation.keypoints) == 0
    finally:
        stop(app)


def test_a_name_that_another_view_has_is_not_taken():
    state = AppState(("a",), "a", Annotation(views=(DESK, DOOR)))
    after = RenameView("desk", "door").apply(state)
    assert after.annotation == state.annotation
    assert "already" in after.notice.text
    assert RenameView("gone", "new").apply(state) is state


def test_a_damaged_file_of_views_is_put_aside_and_said(project):
    (project.folder / "views.json").write_text("{")
    (project.folder / "colors.json").write_text('{"format": "gazeloc-layer-colors"}')
    app = opened(project)
    try:
        app.store.step()
        assert app.store.state.annotation.views == ()
        assert "colors.json.damaged-" in app.store.state.notice.text
        kept = {path.name.split(".")[0]: path.read_text() for path in project.folder.glob("*.damaged-*")}
        assert kept == {"views": "{", "colors": '{"format": "gazeloc-layer-colors"}'}
        step(app, SaveView(DESK))
        assert read_views(project.folder) == (DESK,)
    finally:
        stop(app)


def test_a_name_is_there_once_and_there_are_not_too_many():
    state = AppState(("a",), "a")
    moved = SavedView("desk", (9, 9, 9), (0, 0, 0))
    for view in (DESK, DOOR, moved):
        state = SaveView(view).apply(state)
    assert state.annotation.views == (DOOR, moved)
    for number in range(MAX_VIEWS + 5):
        state = SaveView(SavedView(f"v{number}", (1, 0, 0), (0, 0, 0))).apply(state)
    assert len(state.annotation.views) == MAX_VIEWS
    assert "remove one" in state.notice.text


def test_going_there_and_saving_belong_to_the_browser_that_pressed(monkeypatch):
    server, actions = make_server(0, Routes()), []
    try:
        views = ViewList(server, lambda: {"Top": DESK}, np.array([0.0, 0, 1]), actions.append)
        views.render(AppState(("a",), "a", Annotation(views=(DOOR,))))
        camera = SimpleNamespace(position=(5.0, 5, 5), look_at=(0.0, 0, 0), fov=0.9, up_direction=None)
        client = SimpleNamespace(camera=camera, atomic=server.atomic)
        monkeypatch.setattr(server, "get_clients", lambda: {7: client})
        views._save(SimpleNamespace(client_id=7))
        assert actions == [SaveView(SavedView("View 2", (5, 5, 5), (0, 0, 0), 0.9))]
        views._pressed("door", SimpleNamespace(client_id=7, target=SimpleNamespace(value="Go")))
        assert (camera.position, camera.look_at, camera.fov) == (DOOR.eye, DOOR.target, DOOR.fov_rad)
        views._pressed("door", SimpleNamespace(client_id=8, target=SimpleNamespace(value="Go")))
        views._pressed("door", SimpleNamespace(client_id=7, target=SimpleNamespace(value="Remove")))
        views._pressed("door", SimpleNamespace(client_id=7, target=SimpleNamespace(value="Rename")))
        assert "Type the new name" in actions[2].text
        views._name.value = " gate "
        views._pressed("door", SimpleNamespace(client_id=7, target=SimpleNamespace(value="Rename")))
        assert [actions[1], actions[3]] == [RemoveView("door"), RenameView("door", "gate")]
    finally:
        server.stop()
