"""Sure hands in a real browser: the lens at the pointer, the loupe that moves a keypoint, clicks in the panel."""

from __future__ import annotations

import numpy as np
import pytest
from app_project import SFM_FROM_SCAN, make_app_project, true_poses
from e2e.app_page import AppPage
from gazeloc_app.actions.picks import PickPoint, Side
from gazeloc_app.actions.views import ShowFrame
from gazeloc_app.app import App
from gazeloc_app.placement import shown_scan_from_sfm

pytestmark = pytest.mark.e2e

SPOT = np.array([1.1, 0.3, 0.75])
WALL = np.array([1.5, 0.0, 1.9])
LENS_MIDDLE = """
() => {
  const lens = document.getElementById("gazeloc-lens");
  if (!lens || lens.hidden) return null;
  const size = lens.width, pixel = (x, y) => [...lens.getContext("2d").getImageData(x, y, 1, 1).data].slice(0, 3);
  return pixel(size / 2, size / 2);
}
"""


@pytest.fixture
def page(tmp_path, open_page):
    app = App(make_app_project(tmp_path, tags=False), port=0)
    app.start()
    viewer = open_page(app.address, width=1360, height=760).wait_until_drawn(300).wait_for_clicks()
    yield AppPage(viewer, app)
    app.stop()


def box(page, selector):
    page.page.wait_for_selector(selector, state="attached", timeout=60_000)
    found = page.page.locator(selector).first.bounding_box()
    return np.array([found["x"], found["y"]]), np.array([found["width"], found["height"]])


def show(page, frame):
    page.app.store.dispatch(ShowFrame(frame))
    shown = "() => document.querySelector('.gazeloc-stage')?.dataset.shown"
    page.until(lambda: page.page.evaluate(shown) == str(frame))


def in_panel(page, frame, place):
    """Where in the page the panel's picture of a frame has a place of the room."""
    camera = page.app.data.camera("walk")
    pixel = camera.project(true_poses()[frame].inv().apply(place))[0]
    corner, size = box(page, "img.gazeloc-frame")
    return corner + pixel / (camera.width, camera.height) * size


def test_the_lens_shows_what_is_under_the_pointer_while_shift_is_held(page):
    at = page.viewer.project(WALL)[0]
    page.page.mouse.move(*(at - 5))
    assert page.page.evaluate(LENS_MIDDLE) is None
    page.page.keyboard.down("Shift")
    page.page.mouse.move(*np.floor(at))
    page.until(lambda: page.page.evaluate(LENS_MIDDLE) is not None)
    under = page.viewer.color_at(WALL)
    page.until(lambda: np.abs(np.array(page.page.evaluate(LENS_MIDDLE)) - under).max() < 12)
    page.viewer.save("app-lens")
    page.page.keyboard.up("Shift")
    page.until(lambda: page.page.evaluate(LENS_MIDDLE) is None)


def test_a_click_in_the_loupe_moves_the_place_on_the_scan(page):
    page.viewer.click_at_point(WALL, modifiers=("Shift",))
    page.until(lambda: len(page.pairs) == 1)
    first = np.array(page.pairs[0].scan)
    corner, size = box(page, "#gazeloc-loupe .gazeloc-loupe-box[data-at]")
    page.viewer.save("app-loupe")
    page.page.mouse.click(*(corner + size * (0.7, 0.5)))
    page.until(lambda: page.pairs[0].scan != tuple(first.tolist()))
    moved = np.array(page.pairs[0].scan)
    assert 0.03 < np.linalg.norm(moved - first) < 0.12  # a fifth of 25 cm, and slanted
    assert abs(moved[1]) < 0.01  # still on the wall
    assert len(page.pairs) == 1


def test_a_spot_clicked_in_two_frames_of_the_panel_is_a_place_and_its_click_can_be_dragged_and_nudged(page):
    for count, frame in enumerate((0, 8), start=1):
        show(page, frame)
        page.page.keyboard.down("Shift")
        page.page.mouse.click(*np.floor(in_panel(page, frame, SPOT)))
        page.page.keyboard.up("Shift")
        page.until(lambda count=count: page.pairs and len(page.pairs[0].sightings) == count)
    assert np.linalg.norm(SFM_FROM_SCAN.inverse().apply(page.pairs[0].sfm) - SPOT) < 0.03
    show(page, 4)
    page.page.wait_for_selector(".gazeloc-stage .gazeloc-keypoints path", state="attached")  # expected there
    show(page, 8)
    corner, size = box(page, ".gazeloc-stage circle.gazeloc-grip[data-frame='8']")
    before, mouse = page.pairs[0].sightings[-1], page.page.mouse
    mouse.move(*(corner + size / 2))
    mouse.down()
    mouse.move(*np.add(corner + size / 2, (6, 0)), steps=3)
    mouse.up()
    page.until(lambda: page.pairs[0].sightings[-1] != before)
    dragged = page.pairs[0].sightings[-1]
    across = box(page, "img.gazeloc-frame")[1][0]
    assert dragged.x_px - before.x_px == pytest.approx(6 * page.app.data.camera("walk").width / across, abs=1.0)
    page.page.keyboard.press("ArrowRight")
    page.until(lambda: page.pairs[0].sightings[-1] != dragged)
    assert page.pairs[0].sightings[-1].x_px == pytest.approx(dragged.x_px + 1)
    page.page.keyboard.press("Control+z")
    page.until(lambda: page.pairs[0].sightings[-1] == dragged)
    page.viewer.save("app-frame-clicks")


def test_a_marker_of_the_reconstruction_is_dragged_in_the_view(page):
    x, y, z = SFM_FROM_SCAN.apply([1.5, 0.4, 1.6]).tolist()
    page.app.store.dispatch(PickPoint(Side.SFM, (x, y, z)))
    page.viewer.wait_for_node("/keypoints/k1/sfm")
    start = page.viewer.project(shown_scan_from_sfm(page.app.data, page.state).apply((x, y, z)))[0]
    mouse = page.page.mouse
    mouse.move(*start)
    page.page.wait_for_timeout(300)
    mouse.down()
    mouse.move(*np.add(start, (10, 6)), steps=4)
    mouse.move(*np.add(start, (24, 12)), steps=4)
    page.page.wait_for_timeout(200)
    mouse.move(*np.add(start, (25, 12)))
    page.until(lambda: page.page.evaluate(LENS_MIDDLE) is not None)
    mouse.up()
    page.until(lambda: page.pairs[0].sfm != (x, y, z))
    assert len(page.state.past) == 2
