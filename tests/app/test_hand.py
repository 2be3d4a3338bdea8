"""One browser's hand: clicks in the panel's frames and in the loupe, and arrow keys, on a room whose truth is known."""

from __future__ import annotations

from types import SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
import pytest
from app_project import SFM_FROM_SCAN, true_poses
from app_steps import step
from gazeloc_app.actions.history import Undo
from gazeloc_app.actions.pairs import SelectPair
from gazeloc_app.actions.picks import PickPoint, Side
from gazeloc_app.actions.views import ShowFrame
from gazeloc_app.frames.frame_marks import view_of
from gazeloc_app.frames.frame_snapping import snap_pixel
from gazeloc_app.frames.looking import Target
from gazeloc_app.keypoints.hand import Hand, Reach
from gazeloc_app.keypoints.loupe import ACROSS_M, loupe_places
from gazeloc_app.keypoints.moving import Nudge
from gazeloc_app.panels.looking import LookingControls

from gazeloc_core.errors import InputError
from gazeloc_core.tag_types import TagSightings

PLACE = np.array([1.1, 0.3, 0.75])
RED_MARK = (3.0, 0.02, 1.1)
UPRIGHT = np.array([0.5**0.5, -(0.5**0.5), 0.0, 0.0])
"""A camera that looks along y, z up."""


@pytest.fixture
def hand(app):
    """A hand whose actions are applied at once."""
    hand = SimpleNamespace(pictured=None, in_cloud=False, moves=False, snaps=True)
    client = SimpleNamespace(camera=SimpleNamespace(wxyz=UPRIGHT))
    hand.it = Hand(
        Reach(
            client,
            app.data,
            hand,
            lambda: app.store.state,
            lambda action: step(app, action),
            lambda: 0,
            lambda: hand.in_cloud,
            lambda: hand.moves,
            lambda: hand.snaps,
        )
    )
    return hand


def pairs(app):
    return app.store.state.annotation.keypoints.pairs


def pixel_of(app, frame, place=PLACE):
    return app.data.camera("walk").project(true_poses()[frame].inv().apply(place))[0]


def click(app, hand, frame, pixel, **more):
    camera = app.data.camera("walk")
    u, v = np.array(pixel) / (camera.width, camera.height)
    hand.it.click_in_frame({"frame": str(frame), "u": str(u), "v": str(v), "across": "400", **more})


def test_clicks_in_two_frames_of_the_panel_are_a_place_and_arrows_move_the_last_click_by_a_pixel_and_a_tenth(app, hand):
    click(app, hand, 0, pixel_of(app, 0))
    click(app, hand, 8, pixel_of(app, 8))
    (pair,) = pairs(app)
    np.testing.assert_allclose(pair.sfm, SFM_FROM_SCAN.apply(PLACE), atol=1e-6)
    step(app, ShowFrame(8))
    steps = len(app.store.state.past)
    hand.it.nudge(Nudge((1, 0)))
    hand.it.nudge(Nudge((0, -1), step_px=0.1))
    (moved,) = pairs(app)
    np.testing.assert_allclose(
        [moved.sightings[-1].x_px, moved.sightings[-1].y_px], np.add(pixel_of(app, 8), (1, -0.1))
    )
    assert moved.sfm != pair.sfm
    assert len(app.store.state.past) == steps + 2
    step(app, Undo(), Undo())
    assert pairs(app) == (pair,)


def test_a_click_in_the_picture_as_recorded_is_the_same_click(app, hand):
    recording = app.data.recording("walk")
    ray = app.data.camera("walk").unproject([pixel_of(app, 0)])
    u, v = recording.camera.project(ray)[0] / (recording.camera.width, recording.camera.height)
    hand.it.click_in_frame({"frame": "0", "u": str(u), "v": str(v), "across": "400", "lens": "1"})
    click_ = pairs(app)[0].sightings[0]
    np.testing.assert_allclose([click_.x_px, click_.y_px], pixel_of(app, 0), atol=1e-4)


def test_a_click_of_a_pair_is_moved_by_its_key_and_one_that_is_not_there_is_made(app, hand):
    click(app, hand, 0, pixel_of(app, 0))
    click(app, hand, 8, pixel_of(app, 8))
    click(app, hand, 8, (100, 90), key="k1")
    assert (pairs(app)[0].sightings[-1].x_px, pairs(app)[0].sightings[-1].y_px) == pytest.approx((100, 90))
    click(app, hand, 12, pixel_of(app, 12), key="k1")
    assert len(pairs(app)[0].sightings) == 3


def test_a_place_among_the_points_is_replaced_only_where_that_is_wanted(app, hand):
    step(app, PickPoint(Side.SFM, (1, 2, 3)))
    click(app, hand, 0, (100, 90), key="k1")
    assert pairs(app)[0].sfm == (1, 2, 3)
    assert "Move point" in app.store.state.notice.text
    hand.moves = True
    click(app, hand, 0, (100, 90), key="k1")
    assert (pairs(app)[0].sfm, len(pairs(app)[0].sightings)) == (None, 1)


def test_frames_without_a_place_in_the_reconstruction_say_so(app, hand):
    click(app, hand, 1, (100, 90))  # every second frame is a keyframe
    assert pairs(app) == ()
    assert "frame 0 is one" in app.store.state.notice.text or "frame 2 is one" in app.store.state.notice.text


@pytest.mark.parametrize(
    "query",
    [
        {},
        {"frame": "0", "u": "0.5"},
        {"frame": "0", "u": "nan", "v": "0.5", "across": "400"},
        {"frame": "0", "u": "0.5", "v": "1.5", "across": "400"},
        {"frame": "99", "u": "0.5", "v": "0.5", "across": "400"},
        {"frame": "-1", "u": "0.5", "v": "0.5", "across": "400"},
        {"frame": "0", "u": "0.5", "v": "0.5", "across": "0"},
        {"frame": "0", "u": "0.5", "v": "0.5", "across": "400", "key": "k9"},
    ],
)
def test_what_a_page_makes_up_is_refused_in_a_sentence(app, hand, query):
    with pytest.raises(InputError):
        hand.it.click_in_frame(query)
    assert pairs(app) == ()


def test_a_click_in_the_loupe_moves_the_place_along_the_scan(app, hand):
    step(app, PickPoint(Side.SCAN, RED_MARK))
    at, start = loupe_places(app.data, app.store.state, RED_MARK)
    query = {"key": "k1", "at": at, "from": start}
    hand.it.click_in_loupe({**query, "u": "0.5", "v": "0.5"})
    np.testing.assert_allclose(pairs(app)[0].scan, RED_MARK, atol=1e-3)
    hand.it.click_in_loupe({**query, "u": str(0.5 + 0.01 / ACROSS_M), "v": "0.5"})
    assert 0.009 < np.linalg.norm(np.array(pairs(app)[0].scan) - RED_MARK) < 0.013  # the wall is seen at a slant
    for wrong in ({"u": "2"}, {"at": "1,2"}, {"from": at}):
        with pytest.raises(InputError):
            hand.it.click_in_loupe({**query, "u": "0.5", "v": "0.5", **wrong})
    hand.it.click_in_loupe({**query, "key": "k7", "u": "0.5", "v": "0.5"})
    assert len(pairs(app)) == 1


def test_arrows_move_the_side_that_the_tool_in_hand_sets(app, hand):
    step(app, PickPoint(Side.SCAN, RED_MARK), PickPoint(Side.SFM, (1, 2, 3)))
    hand.it.nudge(Nudge((1, 0)))
    assert np.linalg.norm(np.array(pairs(app)[0].scan) - RED_MARK) == pytest.approx(0.002, abs=1e-4)
    assert pairs(app)[0].sfm == (1, 2, 3)
    hand.in_cloud, before = True, pairs(app)[0].scan
    hand.it.nudge(Nudge((1, 0)))
    assert pairs(app)[0].scan == before
    assert 0 < np.linalg.norm(np.array(pairs(app)[0].sfm) - (1, 2, 3)) < 0.01
    step(app, SelectPair(None))
    before = app.store.state
    hand.it.nudge(Nudge((1, 0)))
    assert app.store.state is before  # they turn the view then


def test_a_pages_arrow_key_is_one_of_four(app, hand):
    step(app, PickPoint(Side.SCAN, RED_MARK))
    hand.it.press_arrow({"key": "arrowleft", "shift": "1"})
    assert np.linalg.norm(np.array(pairs(app)[0].scan) - RED_MARK) == pytest.approx(0.01, abs=5e-4)
    for query in ({}, {"key": "arrow"}, {"key": "up"}):
        with pytest.raises(InputError):
            hand.it.press_arrow(query)


def test_in_a_frame_that_is_looked_through_arrows_move_the_click(app, hand):
    click(app, hand, 0, pixel_of(app, 0))
    hand.it.look_elsewhere()
    before = pairs(app)
    hand.it.nudge(Nudge((1, 0)))
    assert pairs(app) == before  # nothing of it is on the screen
    hand.pictured = Target("walk", 0)
    hand.it.nudge(Nudge((1, 0)))
    assert pairs(app)[0].sightings[0].x_px == pytest.approx(pixel_of(app, 0)[0] + 1)


def test_a_click_is_dragged_in_the_picture_that_is_looked_through_as_one_step(app, hand):
    click(app, hand, 0, pixel_of(app, 0))
    hand.target = Target("walk", 0)
    controls = LookingControls(MagicMock(), app.data, hand, lambda: app.store.state, lambda action: step(app, action))
    view, grip = view_of(app.data, app.store.state, Side.SFM, 0), SimpleNamespace(position=None, opacity=0.0)
    eye = view.scan_from_camera.translation

    def drag(phase, pixel):
        ray = view.scan_from_camera.rotation.apply(view.camera.unproject([pixel])[0])
        camera = SimpleNamespace(position=eye)
        pointer = eye + 0.7 * ray
        client = SimpleNamespace(camera=camera)
        controls._drag("k1", SimpleNamespace(phase=phase, end_position=pointer, client=client, target=grip))

    steps = len(app.store.state.past)
    for phase, pixel in (("start", (100, 90)), ("update", (110, 92)), ("end", (120.25, 95.5))):
        drag(phase, pixel)
    (moved,) = pairs(app)[0].sightings
    assert (moved.x_px, moved.y_px) == pytest.approx((120.25, 95.5), abs=1e-6)
    np.testing.assert_allclose(view.pixel_of(grip.position), (110, 92), atol=1e-6)
    assert len(app.store.state.past) == steps + 1
    drag("end", (-20, 90))
    assert pairs(app)[0].sightings == (moved,)
    assert "beside" in app.store.state.notice.text


def test_a_click_near_a_tags_corner_in_a_frame_is_that_corner_and_the_row_says_so(app, hand):
    corners = np.array([[100.0, 80], [130, 84], [128, 110], [96, 104]])
    app.data.seen_tags = lambda of: TagSightings(np.array([0]), np.array([7]), corners[None], np.array([50.0]))
    click(app, hand, 0, (127.0, 87.0))
    assert (pairs(app)[0].name, pairs(app)[0].sightings[0].x_px, pairs(app)[0].sightings[0].y_px) == (
        "Tag 7, corner 2",
        130.0,
        84.0,
    )
    hand.snaps = False
    step(app, SelectPair(None))
    click(app, hand, 0, (127.0, 87.0))
    assert (pairs(app)[1].name, pairs(app)[1].sightings[0].x_px) == ("Keypoint 2", pytest.approx(127))


def test_a_tags_centre_in_a_frame_is_where_its_diagonals_cross():
    square = np.array([[-1, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]]) * 0.5
    slanted = square @ np.array([[0.5, 0, 0.8], [0, 1, 0], [0, 0, 1]]) + (0.2, 0.1, 2)
    corners = 300 * slanted[:, :2] / slanted[:, 2:] + 200
    true_centre = 300 * np.array([0.2, 0.1]) / 2 + 200
    tags = TagSightings(np.array([3]), np.array([1]), corners[None], np.array([50.0]))
    found = snap_pixel(tags, 3, true_centre + 2, 5.0)
    assert found.name == "Tag 1, centre"
    np.testing.assert_allclose((found.x_px, found.y_px), true_centre)
    assert snap_pixel(tags, 3, true_centre + 9, 5.0) is None
    assert snap_pixel(tags, 4, true_centre, 5.0) is None
    assert snap_pixel(None, 3, true_centre, 5.0) is None
