"""One browser's clicks, without a page: looking through the phone's cameras, and what clicks in their pictures make."""

from __future__ import annotations

from concurrent.futures import Future
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
import pytest
from gazeloc_app.actions.picks import PickPoint, Side
from gazeloc_app.actions.views import ShowLayer
from gazeloc_app.browser import Browser
from gazeloc_app.drawing.render_jobs import Photo
from gazeloc_app.keypoints.picking import ClickFilter
from gazeloc_app.scene.frames import PLANE_M
from gazeloc_app.state import AppState, Layer
from gazeloc_app.tools.all import TOOLS
from gazeloc_app.tools.camera import CameraTool
from gazeloc_app.tools.cloud_point import CloudPointTool
from gazeloc_app.tools.frame_point import FramePointTool
from gazeloc_app.tools.tape import TapeTool
from gazeloc_app.tools.tool import Click, Tool
from scipy.spatial.transform import RigidTransform

from gazeloc_core.camera import Camera
from gazeloc_core.scan import Mesh, RoomScan, ScanFrame
from gazeloc_core.surfaces.raycast import Raycaster

CAMERA = Camera.pinhole(960, 720, 720, 720, 470, 350)
PLACE = np.array([0.1, 0.2, 2.5])
EYE = np.array([0.0, -3.0, 0.0])


@pytest.fixture
def scan() -> RoomScan:
    mesh = Mesh(np.array([[-1, 0, 4], [1, 0, 4], [0, 1, 4]]), np.array([[0, 1, 2]]))
    frames = [
        ScanFrame(f"frame_{i}", i, CAMERA, RigidTransform.from_translation((x, 0, 0)), picture)
        for i, (x, picture) in enumerate([(0.0, Path("0.jpg")), (0.5, None), (1.0, Path("2.jpg"))])
    ]
    return RoomScan(Path("scan"), "test", mesh, tuple(frames))


@pytest.fixture
def page(scan: RoomScan) -> SimpleNamespace:
    """A browser whose actions are applied at once; `mode` is its widget's value."""
    page = SimpleNamespace(state=AppState(("walk",), "walk"), jobs=[])
    client = MagicMock()
    client.camera.image_width, client.camera.image_height, client.camera.fov = 1200, 800, 1.0
    data = MagicMock()
    data.scan.return_value = scan
    data.trajectory.return_value = None
    data.seen_tags.return_value = None
    render = MagicMock()
    render.submit.side_effect = lambda job, key: page.jobs.append(job) or Future()

    def dispatch(action):
        page.state = action.apply(page.state)

    page.browser = Browser(client, data, MagicMock(front=0), render, lambda: page.state, dispatch)
    page.client, page.data, page.browser._move.value = client, data, False
    return page


def take(page: SimpleNamespace, tool: type[Tool]) -> None:
    page.browser._choice.value = tool.name
    page.browser._filter = ClickFilter()


def click(page: SimpleNamespace, direction: np.ndarray, **how: bool) -> None:
    page.browser.click(Click(EYE, direction), **how)


def look(page: SimpleNamespace, scan: RoomScan, frame: int) -> None:
    """Click the camera of one of the frames that have a picture."""
    take(page, CameraTool)
    centre = np.asarray(scan.frames_with_images[frame].scan_from_camera.translation)
    click(page, centre + np.array([0, 0, 0.05]) - EYE)


def click_spot(page: SimpleNamespace, scan: RoomScan, frame: int, place: np.ndarray = PLACE) -> None:
    """Click, from beside the camera, the pixel of the picture where the place is."""
    take(page, FramePointTool)
    pose = scan.frames_with_images[frame].scan_from_camera
    local = pose.inv().apply(place)
    in_picture = pose.apply(local / local[2] * PLANE_M)
    click(page, in_picture - EYE)


def test_a_click_on_the_phones_camera_looks_through_it(page, scan):
    look(page, scan, 1)
    (job,) = page.jobs
    assert isinstance(job, Photo)
    assert job.path == "2.jpg"
    np.testing.assert_allclose(page.client.camera.position, [1, 0, 0])


def test_a_camera_without_a_picture_or_in_a_hidden_layer_is_not_looked_through(page, scan):
    take(page, CameraTool)
    click(page, np.array([0.5, 0, 0.05]) - EYE)
    page.state = ShowLayer(Layer.PHONE, False).apply(page.state)
    look(page, scan, 0)
    assert page.jobs == []


def test_a_click_on_an_estimate_goes_to_its_frame_unless_its_layer_is_hidden(page):
    trajectory = MagicMock(localised_keyframes=np.array([4, 7]))
    trajectory.poses.return_value = RigidTransform.from_translation([[3.0, 0, 0], [3.0, 0, 2.0]])
    page.data.trajectory.return_value = trajectory
    take(page, CameraTool)
    click(page, np.array([3.0, 0, 2.05]) - EYE)
    assert page.state.frame == 7
    page.state = ShowLayer(Layer.ESTIMATE, False).apply(page.state)
    take(page, CameraTool)
    click(page, np.array([3.0, 0, 0.05]) - EYE)
    assert page.state.frame == 7


def test_one_spot_clicked_in_two_of_the_phones_pictures_is_a_place_on_the_scan(page, scan):
    for frame in (0, 1):
        look(page, scan, frame)
        click_spot(page, scan, frame)
    (pair,) = page.state.annotation.keypoints
    np.testing.assert_allclose(pair.scan, PLACE, atol=1e-6)
    assert [sighting.frame_index for sighting in pair.scan_sightings] == [0, 1]
    assert pair.scan_sigma > 0
    assert pair.sfm is None
    assert pair.sightings == ()


def test_a_click_in_a_picture_does_not_move_a_place_that_was_clicked_on_the_mesh(page, scan):
    page.state = PickPoint(Side.SCAN, (1, 2, 3)).apply(page.state)
    look(page, scan, 0)
    click_spot(page, scan, 0)
    assert [pair.scan for pair in page.state.annotation.keypoints] == [(1, 2, 3), None]


def test_clicks_on_different_things_give_no_place_and_say_so(page, scan):
    for frame, place in ((0, PLACE), (1, PLACE + np.array([0, 0.4, 0]))):
        look(page, scan, frame)
        click_spot(page, scan, frame, place)
    assert page.state.annotation.keypoints.pairs[0].scan is None
    assert "disagree" in page.state.notice.text


def test_moving_the_frame_slider_leaves_the_phones_picture(page, scan):
    look(page, scan, 0)
    page.browser.render(page.state)
    assert len(page.jobs) == 1


ON_MESH = np.array([0.1, 0.2, 4.0])


def test_a_click_with_shift_sets_a_point_on_the_scan_whatever_the_tool(page, scan):
    page.data.raycaster.return_value = Raycaster(scan.mesh)
    take(page, CameraTool)
    click(page, ON_MESH - EYE)
    assert len(page.state.annotation.keypoints) == 0
    take(page, CameraTool)
    click(page, ON_MESH - EYE, is_shifted=True)
    (pair,) = page.state.annotation.keypoints
    np.testing.assert_allclose(pair.scan, ON_MESH, atol=1e-6)


def test_a_click_with_shift_sets_a_point_in_the_frame_that_is_looked_through(page, scan):
    look(page, scan, 1)
    page.browser._filter = ClickFilter()
    pose = scan.frames_with_images[1].scan_from_camera
    click(page, pose.apply(np.array([0.02, 0.01, PLANE_M])) - EYE, is_shifted=True)
    (pair,) = page.state.annotation.keypoints
    assert [sighting.frame_index for sighting in pair.scan_sightings] == [1]


def test_taking_another_tool_puts_the_first_away(page):
    put_away = []
    page.browser.tool.put_away = lambda: put_away.append("camera")
    page.browser._next_tool()
    page.browser._next_tool()
    assert put_away == ["camera"]
    assert isinstance(page.browser.tool, CloudPointTool)


@pytest.mark.parametrize(
    ("origin", "direction"),
    [([0, 0, 0], [0, 0, 0]), ([0, np.nan, 0], [0, 0, 1]), ([0, 0], [0, 0, 1]), ("abc", [0, 0, 1]), (None, None)],
)
def test_what_a_browser_sends_for_a_ray_that_is_none_is_no_click(origin, direction):
    assert Click.of(origin, direction) is None


def test_every_tool_says_in_words_of_its_own_what_it_does():
    assert len({kind.name for kind in TOOLS}) == len(TOOLS)
    assert all(kind.name[0].islower() and kind.hint.endswith(".") for kind in TOOLS)


def test_a_tape_measures_between_two_clicks_and_rolls_up(page, scan):
    page.data.raycaster.return_value = Raycaster(scan.mesh)
    take(page, TapeTool)
    page.browser._take()
    layer = page.browser.tool._layer
    layer.show = MagicMock()
    click(page, np.array([0.0, 0.2, 4.0]) - EYE)
    page.browser._filter = ClickFilter()
    click(page, np.array([0.3, 0.6, 4.0]) - EYE)
    (ends, text), _ = layer.show.call_args
    np.testing.assert_allclose(ends, [[0.0, 0.2, 4.0], [0.3, 0.6, 4.0]], atol=1e-6)
    assert text == "50.0 cm (40.0 cm up)"
    page.browser._filter = ClickFilter()
    click(page, ON_MESH - EYE)
    assert len(layer.show.call_args[0][0]) == 1  # the third click starts anew
    take(page, CameraTool)
    page.browser._take()
    assert layer.show.call_args[0] == ((),)
    assert len(page.state.annotation.keypoints) == 0


def test_shift_sets_a_point_with_the_tape_in_hand_too(page, scan):
    page.data.raycaster.return_value = Raycaster(scan.mesh)
    take(page, TapeTool)
    click(page, ON_MESH - EYE, is_shifted=True)
    assert len(page.state.annotation.keypoints) == 1
