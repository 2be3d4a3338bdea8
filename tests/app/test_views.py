"""Saved views: kept with the project, shared by its recordings, removed again; and a camera that goes there."""

from types import SimpleNamespace

import numpy as np
import pytest
from app_project import make_app_project
from app_steps import step, stop
from gazeloc_app.actions.choices import OpenRecording
from gazeloc_app.actions.places import RemoveView, SaveView
from gazeloc_app.app import App
from gazeloc_app.panels.views import ViewList
from gazeloc_app.routes import Routes
from gazeloc_app.server import make_server
from gazeloc_app.state import AppState

from gazeloc_core.saved_views import MAX_VIEWS, SavedView, read_views

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
    return {handle.label for handle in handles if getattr(handle, "options", None) == ("Go", "Remove")}


def test_views_are_on_the_disk_after_the_step_and_there_at_the_next_start(project):
    app = opened(project)
    step(app, SaveView(DESK), SaveView(DOOR))
    assert read_views(project.folder) == (DESK, DOOR)
    assert labels(app) == {"desk", "door"}
    step(app, RemoveView("desk"))
    stop(app)
    app = opened(project)
    try:
        assert app.store.state.views == (DOOR,)
        assert labels(app) == {"door"}
        step(app, OpenRecording("other", lambda: app._saver.open("other")))
        assert app.store.state.recording == "other"
        assert app.store.state.views == (DOOR,)
    finally:
        stop(app)


def test_a_damaged_file_of_views_is_put_aside_and_said(project):
    (project.folder / "views.json").write_text("{")
    app = opened(project)
    try:
        app.store.step()
        assert app.store.state.views == ()
        assert "views.damaged.json" in app.store.state.notice.text
        assert (project.folder / "views.damaged.json").read_text() == "{"
        step(app, SaveView(DESK))
        assert read_views(project.folder) == (DESK,)
    finally:
        stop(app)


def test_a_name_is_there_once_and_there_are_not_too_many():
    state = AppState(("a",), "a")
    moved = SavedView("desk", (9, 9, 9), (0, 0, 0))
    for view in (DESK, DOOR, moved):
        state = SaveView(view).apply(state)
    assert state.views == (DOOR, moved)
    for number in range(MAX_VIEWS + 5):
        state = SaveView(SavedView(f"v{number}", (1, 0, 0), (0, 0, 0))).apply(state)
    assert len(state.views) == MAX_VIEWS
    assert "remove one" in state.notice.text


def test_going_there_and_saving_belong_to_the_browser_that_pressed(monkeypatch):
    server, actions = make_server(0, Routes()), []
    try:
        views = ViewList(server, lambda: {"Top": DESK}, np.array([0.0, 0, 1]), actions.append)
        views.render(AppState(("a",), "a", views=(DOOR,)))
        camera = SimpleNamespace(position=(5.0, 5, 5), look_at=(0.0, 0, 0), fov=0.9, up_direction=None)
        client = SimpleNamespace(camera=camera, atomic=server.atomic)
        monkeypatch.setattr(server, "get_clients", lambda: {7: client})
        views._save(SimpleNamespace(client_id=7))
        assert actions == [SaveView(SavedView("View 2", (5, 5, 5), (0, 0, 0), 0.9))]
        views._pressed("door", SimpleNamespace(client_id=7, target=SimpleNamespace(value="Go")))
        assert (camera.position, camera.look_at, camera.fov) == (DOOR.eye, DOOR.target, DOOR.fov_rad)
        views._pressed("door", SimpleNamespace(client_id=8, target=SimpleNamespace(value="Go")))
        views._pressed("door", SimpleNamespace(client_id=7, target=SimpleNamespace(value="Remove")))
        assert actions[1:] == [RemoveView("door")]
    finally:
        server.stop()
