"""A project that has a scan and no recording opens: the room, its views and the tape, and how to add a recording."""

import json
import shutil
from dataclasses import replace
from unittest.mock import MagicMock

import pytest
from app_project import make_app_project
from app_steps import step, stop
from gazeloc_app.actions.history import Undo
from gazeloc_app.actions.places import SaveView
from gazeloc_app.actions.views import TintLayer
from gazeloc_app.app import App
from gazeloc_app.frames.gaze_at import gaze_in_scan
from gazeloc_app.panels.layers import LayerPanel
from gazeloc_app.panels.no_recording import NoRecording
from gazeloc_app.state import Layer
from gazeloc_app.tools.all import TOOLS, kinds_for, shifted
from gazeloc_app.tools.camera import CameraTool
from gazeloc_app.tools.tape import TapeTool

from gazeloc_core.surfaces.saved_views import SavedView

VIEW = SavedView.of("door", (1.0, 1.0, 1.5), (2.0, 2.0, 1.0), 0.9)


@pytest.fixture
def project(tmp_path):
    project = make_app_project(tmp_path)
    project.save(replace(project.settings, recordings={}, chosen={}))
    shutil.rmtree(project.folder / "recordings")
    return project


def test_it_shows_the_room_and_says_how_to_add_a_recording(app, project):
    boxes = app.panels.of(LayerPanel)._boxes
    offered = [layer for layer in Layer if boxes[layer].visible]
    assert offered == [Layer.SCAN, Layer.SCAN_TAGS, Layer.GRID, Layer.PEOPLE], "the scan has no pictures of a phone"
    assert f"gazeloc add {project.folder} RECORDING" in app.panels.of(NoRecording)._card.content
    assert gaze_in_scan(app.data, "", 0, None) is None, "it is asked for once the frame rests"
    assert "/scan" in "".join(app.server.scene._handle_from_node_name)


def test_views_and_tints_are_kept_and_undone_and_nothing_is_written_for_a_recording(app, project):
    step(app, SaveView(VIEW), TintLayer(Layer.SCAN, (200, 100, 50), 1))
    step(app, Undo())
    assert [view.name for view in app.store.state.annotation.views] == ["door"]
    assert app.store.state.annotation.tints == ()
    assert not app._saver.has_unsaved
    stop(app)
    assert not (project.folder / "recordings").exists()
    assert [path.name for path in (project.folder / "annotations").glob("*.jsonl")] == []
    again = App(project, port=0)
    try:
        assert [view.name for view in again.store.state.annotation.views] == ["door"]
    finally:
        stop(again)
    assert json.loads((project.folder / "project.json").read_text())["recordings"] == {}


def test_a_click_measures_or_goes_to_a_camera_and_never_sets_a_keypoint(app):
    assert kinds_for(app.store.state) == (CameraTool, TapeTool)
    assert kinds_for(replace(app.store.state, recordings=("walk",), recording="walk")) == TOOLS
    tools = {kind.name: kind(MagicMock(data=app.data)) for kind in kinds_for(app.store.state)}
    for tool in tools.values():
        assert shifted(tool, tools) is tool
