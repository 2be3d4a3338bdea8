"""Script in names: whatever people call a folder, a keypoint or a note is text on every page, never markup."""

import re
import shutil

import pytest
from app_project import make_app_project
from app_steps import step, stop
from gazeloc_app.actions.action import Notify
from gazeloc_app.actions.marks import NoteFrame
from gazeloc_app.actions.pairs import RenamePair
from gazeloc_app.actions.picks import PickPoint, Side
from gazeloc_app.app import App
from gazeloc_app.page import dress
from gazeloc_app.state import Level
from visitor import get
from websockets.datastructures import Headers
from websockets.http11 import Response

from gazeloc_core.errors import GazelocError
from gazeloc_core.project import Project

SCRIPT = "<img src=x onerror=alert(1)>'\"><script>alert(2)<∕script>"


@pytest.fixture
def app(tmp_path):
    plain = make_app_project(tmp_path)
    folder = tmp_path / SCRIPT
    shutil.move(plain.folder, folder)
    app = App(Project.open(folder), port=0)
    app.store._render()
    yield app
    stop(app)


def markup(app):
    """The HTML of all widgets, as it goes to the pages."""
    sent = [
        message.as_serializable_dict()
        for message in app.server._websock_server._broadcast_buffer.message_from_id.values()
    ]
    fields = [message.get("props") or message.get("updates") or {} for message in sent]
    found = [value for field in fields for name, value in field.items() if name == "content"]
    assert len(found) > 5
    return "".join(found)


def test_script_in_a_keypoint_a_notice_and_the_projects_folder_is_text(app):
    step(app, PickPoint(Side.SCAN, (1, 2, 0.5)))
    (pair,) = app.store.state.annotation.keypoints.pairs
    step(app, RenamePair(pair.key, SCRIPT), NoteFrame(0, SCRIPT), Notify(Level.WARNING, SCRIPT))
    shown = markup(app)
    assert "&lt;img src=x" in shown
    assert "<img src=x" not in shown
    assert "<script" not in shown
    assert "<img src=x" not in get(app.server.get_port())[2].decode()


@pytest.mark.parametrize("name", [SCRIPT, "../up", "a/b", "a\\b", "", ".", "a\0b"])
def test_a_recording_cannot_be_called_so(app, name):
    entry = next(iter(app.project.settings.recordings.values()))
    with pytest.raises(GazelocError):
        app.project.add_recording(name, entry)


def test_the_pages_title_is_text():
    response = Response(200, "OK", Headers({"Content-Length": "1"}), b"<html><head><title>viser</title></head></html>")
    dress(response, "/", f"</title>{SCRIPT}")
    assert re.search(r"<title>([^<]*)</title>", response.body.decode())[1].startswith("&lt;/title&gt;&lt;img")
