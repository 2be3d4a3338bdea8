"""The loupe shows the place in its middle, and takes nothing from a page but two places."""

from __future__ import annotations

import asyncio

import cv2
import numpy as np
import pytest
from app_project import MARKS, SFM_FROM_SCAN, make_app_project
from app_steps import step, stop
from gazeloc_app.actions.picks import PickPoint, Side
from gazeloc_app.app import App
from gazeloc_app.keypoints.loupe import add_loupe_route, loupe_places, loupe_url, pose_facing
from gazeloc_app.panels.loupe import LoupePanel
from gazeloc_app.routes import Routes

RED_MARK = (3.0, 0.02, 1.1)


@pytest.fixture
def app(tmp_path):
    app = App(make_app_project(tmp_path, tags=False), port=0)
    app.store._render()
    yield app
    stop(app)


@pytest.fixture
def routes(app):
    routes = Routes()
    add_loupe_route(routes, app.data, app._render)
    return routes


def test_the_middle_of_the_loupe_is_the_place_and_its_edges_are_what_is_around(app, routes):
    reply = asyncio.run(routes.answer(loupe_url(*loupe_places(app.data, app.store.state, RED_MARK), 0)))
    picture = cv2.cvtColor(cv2.imdecode(np.frombuffer(reply.body, np.uint8), cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)
    assert picture.shape == (320, 320, 3)
    color = np.array(MARKS[2][2])
    assert np.abs(picture[150:170, 150:170].astype(int) - color).max() < 40  # 16 of its 25 cm across are the mark
    assert np.abs(picture[3:8, 3:8].astype(int) - color).max() > 60


@pytest.mark.parametrize(
    "query",
    ["", "at=1,2&from=0,0,0", "at=1,2,x&from=0,0,0", "at=1,2,nan&from=0,0,0", "at=1,2,3&from=1,2,3", "at=1e9,0,0"],
)
def test_what_is_no_place_is_refused_in_a_sentence(routes, query):
    reply = asyncio.run(routes.answer(f"/loupe.jpg?{query}"))
    assert reply.status == 404
    assert reply.body.decode().endswith(".")


def test_a_frames_picture_is_answered_and_no_other(routes):
    assert asyncio.run(routes.answer("/loupe/walk/3.jpg")).body[:2] == b"\xff\xd8"
    assert asyncio.run(routes.answer("/loupe/walk/x.jpg")).status == 404
    assert asyncio.run(routes.answer("/loupe/nobody/3.jpg")).status == 404


def test_one_can_look_straight_down(app):
    up = np.array([0.0, 0, 1])
    pose = pose_facing(np.array([0.0, 0, 2]), np.array([0.0, 0, 0]), up)
    np.testing.assert_allclose(pose.inv().apply(np.zeros(3)), (0, 0, 2), atol=1e-9)


def test_the_panel_shows_the_selected_keypoint_on_the_scan_and_in_frames(app):
    step(app, PickPoint(Side.SCAN, RED_MARK))
    panel = LoupePanel(app.server.gui, app.data)
    panel.render(app.store.state)
    assert "/loupe.jpg?at=3.0" in panel._html.content
    x, y, z = SFM_FROM_SCAN.apply(np.array(RED_MARK)).tolist()
    step(app, PickPoint(Side.SFM, (x, y, z)))
    panel.render(app.store.state)
    assert panel._html.content.count("/loupe/walk/") == 2
    assert "expected" in panel._html.content
