"""Keypoints in frames: a line after one click, the place after two, and the next frame that sees it."""

from __future__ import annotations

from unittest.mock import MagicMock

import numpy as np
import pytest
from app_project import SFM_FROM_SCAN, make_app_project, true_poses
from app_steps import step, stop
from gazeloc_app.actions.pairs import RenamePair, SelectPair
from gazeloc_app.actions.picks import PickPoint, PickSighting, Side
from gazeloc_app.actions.views import ShowFrame
from gazeloc_app.app import App
from gazeloc_app.frames.frame_marks import marks_in_frame, next_frame_seeing
from gazeloc_app.frames.looking import Looking, Target
from gazeloc_app.frames.sightings import triangulated
from gazeloc_app.panels.marks_svg import marks_svg

from gazeloc_core.keypoints import Sighting

PLACE = np.array([1.1, 0.3, 0.75])


@pytest.fixture
def app(tmp_path):
    app = App(make_app_project(tmp_path, tags=False), port=0)
    app.store._render()
    yield app
    stop(app)


def true_pixel(app, frame, place=PLACE):
    return app.data.camera("walk").project(true_poses()[frame].inv().apply(place))[0]


def clicked(app, frame):
    x, y = true_pixel(app, frame).tolist()
    state = app.store.state
    sightings = (*state.annotation.keypoints.pairs[0].sightings, Sighting(frame, x, y)) if state.selected_key else ()
    found = triangulated(app.data, "walk", sightings) if len(sightings) > 1 else (None, None)
    step(app, PickSighting(Sighting(frame, x, y), state.selected_key, *found))


def marks(app, frame, side=Side.SFM):
    return marks_in_frame(app.data, app.store.state, side, frame)


def test_one_click_is_a_mark_there_and_a_line_elsewhere(app):
    clicked(app, 0)
    (mark,), lines = marks(app, 0)
    assert (mark.is_clicked, lines) == (True, [])
    np.testing.assert_allclose((mark.x_px, mark.y_px), true_pixel(app, 0))
    nothing, (line,) = marks(app, 8)
    assert nothing == []
    a, b = line.pixels[0], line.pixels[-1]
    assert abs(np.cross(b - a, true_pixel(app, 8) - a)) / np.linalg.norm(b - a) < 0.01


def test_two_clicks_are_a_place_that_every_other_frame_expects(app):
    clicked(app, 0)
    clicked(app, 8)
    for frame in (4, 12):
        (mark,), lines = marks(app, frame)
        assert (mark.is_clicked, lines) == (False, [])
        np.testing.assert_allclose((mark.x_px, mark.y_px), true_pixel(app, frame), atol=0.05)


def test_a_place_on_the_scan_is_expected_in_frames_once_there_is_an_alignment(app):
    step(app, PickPoint(Side.SCAN, tuple(PLACE.tolist())))
    assert marks(app, 4) == ([], [])
    for place in ((1.0, 0.02, 1.5), (0.02, 0.9, 1.6), (3.0, 0.02, 1.1)):
        x, y, z = SFM_FROM_SCAN.apply(np.array(place)).tolist()
        step(app, SelectPair(None), PickPoint(Side.SCAN, place), PickPoint(Side.SFM, (x, y, z)))
    app.live.fit_wanted()
    app.store.step()
    mark = next(mark for mark in marks(app, 4)[0] if mark.key == "k1")
    np.testing.assert_allclose((mark.x_px, mark.y_px), true_pixel(app, 4), atol=0.05)


def test_the_next_frame_that_sees_the_selected_keypoint(app):
    assert next_frame_seeing(app.data, app.store.state, Side.SFM, 0) is None
    clicked(app, 0)
    clicked(app, 8)
    seeing, frame = [], 8
    for _ in range(8):
        frame = next_frame_seeing(app.data, app.store.state, Side.SFM, frame)
        seeing.append(frame)
    inside = [f for f in range(0, 16, 2) if app.data.camera("walk").contains(true_pixel(app, f)[None])[0]]
    assert set(seeing) <= set(inside)
    assert seeing[0] == min(f for f in inside if f > 8)
    assert next_frame_seeing(app.data, app.store.state, Side.SCAN, 0) is None  # the scan has no photos


def test_the_panels_drawing_has_names_that_cannot_do_harm(app):
    clicked(app, 0)
    step(app, RenamePair("k1", "<script>alert(1)</script>"))
    drawing = marks_svg(*marks(app, 0), app.data.camera("walk"), "k1")
    assert "<script>" not in drawing
    assert "&lt;script&gt;alert(1)&lt;/script&gt;: clicked here" in drawing
    assert "polyline" in marks_svg(*marks(app, 8), app.data.camera("walk"), None)
    assert marks_svg([], [], app.data.camera("walk"), None) == ""


def test_a_frame_that_cannot_be_looked_through_is_said_once_while_the_slider_stays_on_it(app):
    client = MagicMock()
    client.camera.image_width, client.camera.image_height = 800, 600
    looking = Looking(client, app.data, app._render, lambda: app.store.state, app.store.dispatch)
    looking.look(0)
    assert looking.target == Target("walk", 0)
    step(app, ShowFrame(1))  # no keyframe, so it is not in the reconstruction
    for _ in range(3):
        looking.follow(app.store.state)
        app.store.step()
    assert app.store.applied == 2
    step(app, ShowFrame(2))
    looking.follow(app.store.state)
    assert looking.target == Target("walk", 2)


def test_a_view_that_does_not_follow_stays_and_one_without_the_picture_takes_clicks_on_the_scan(app):
    client = MagicMock()
    client.camera.image_width, client.camera.image_height = 800, 600
    looking = Looking(client, app.data, app._render, lambda: app.store.state, app.store.dispatch)
    looking.look(0)
    looking.follows = False
    step(app, ShowFrame(2))
    looking.follow(app.store.state)
    assert looking.target == Target("walk", 0)
    assert looking.pose_and_camera(app.store.state)[0] is not None
    looking.show_picture(False)
    assert (looking.pictured, looking.pose_and_camera(app.store.state)) == (None, (None, None))
    looking.follows = True
    looking.follow(app.store.state)
    assert (looking.target, looking.pictured) == (Target("walk", 2), None)
    looking.show_picture(True)
    assert looking.pictured == Target("walk", 2)
