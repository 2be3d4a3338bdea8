"""Picking in a real browser: shift-click, and clicking one spot in two of the phone's pictures."""

from __future__ import annotations

import numpy as np
import pytest
from app_project import make_app_project
from e2e.app_page import AppPage
from e2e.phone_photos import add_photos
from gazeloc_app.app import App
from gazeloc_app.scene.frames import PLANE_M
from gazeloc_app.tools.camera import CameraTool

pytestmark = pytest.mark.e2e

SPOT = np.array([1.1, 0.3, 0.75])
WALL = np.array([1.5, 0.0, 1.9])


@pytest.fixture
def page(tmp_path, open_page):
    app = App(make_app_project(tmp_path, tags=False), port=0)
    add_photos(app, tmp_path)
    app.start()
    viewer = open_page(app.address, width=1360, height=760).wait_until_drawn(300).wait_for_clicks()
    yield AppPage(viewer, app)
    app.stop()


def test_a_click_with_shift_sets_a_point_on_the_scan_while_a_plain_one_sets_none(page):
    page.viewer.click_at_point(WALL)
    page.page.wait_for_timeout(600)
    assert not page.pairs
    page.viewer.click_at_point(WALL, modifiers=("Shift",))
    page.until(lambda: len(page.pairs) == 1)
    assert np.linalg.norm(np.array(page.pairs[0].scan) - WALL) < 0.01
    assert page.field("A click").input_value() == CameraTool.name


def test_one_spot_in_two_of_the_phones_pictures_is_a_place_on_the_scan(page):
    for number in (1, 2):
        page.field("Phone's frame").fill(str(number))
        page.field("Phone's frame").press("Enter")
        page.viewer.wait_for_node("/picture")
        view = page.app.data.scan().frames_with_images[number]
        local = view.scan_from_camera.inv().apply(SPOT)
        on_picture = view.scan_from_camera.apply(local / local[2] * PLANE_M)
        page.until(
            lambda number=number: any(
                browser.looking.target and browser.looking.target.frame == number
                for browser in page.app.browsers.values()
            )
        )
        page.viewer.wait_until_drawn(300)
        page.viewer.click_at_point(on_picture, modifiers=("Shift",))
        page.until(lambda number=number: page.pairs and len(page.pairs[0].scan_sightings) == number)
        page.viewer.wait_for_node("/picture-marks/lines")
        page.viewer.save(f"app-phone-{number}")
    assert np.linalg.norm(np.array(page.pairs[0].scan) - SPOT) < 0.02
    drag_its_mark_in_the_picture(page)
    page.press("Leave the frame")
    page.viewer.wait_for_node("/picture", present=False).wait_for_node("/picture-marks/lines", present=False)


def drag_its_mark_in_the_picture(page):
    click, view = page.pairs[0].scan_sightings[-1], page.app.data.scan().frames_with_images[2]
    ray = view.camera.unproject([(click.x_px, click.y_px)])[0]
    at = page.viewer.project(view.scan_from_camera.apply(ray / ray[2] * PLANE_M))[0]
    page.viewer.wait_for_node("/picture-grips/k1")
    mouse = page.page.mouse
    mouse.move(*at)
    page.page.wait_for_timeout(300)
    mouse.down()
    mouse.move(*np.add(at, (8, 0)), steps=4)
    mouse.move(*np.add(at, (16, 0)), steps=4)
    page.page.wait_for_timeout(200)
    page.viewer.save("app-phone-drag")
    mouse.up()
    page.until(lambda: page.pairs[0].scan_sightings[-1] != click)
    moved = page.pairs[0].scan_sightings[-1]
    assert moved.x_px - click.x_px > 3 * abs(moved.y_px - click.y_px)
    page.page.keyboard.press("Control+z")
    page.until(lambda: page.pairs[0].scan_sightings[-1] == click)


def test_a_marker_is_dragged_along_the_wall_and_nudged_by_an_arrow(page):
    page.viewer.click_at_point(WALL, modifiers=("Shift",))
    page.until(lambda: len(page.pairs) == 1)
    page.viewer.wait_for_node("/keypoints/k1/scan")
    before = np.array(page.pairs[0].scan)
    start, end = page.viewer.project([before, before + np.array([0.4, 0.0, -0.2])])
    mouse = page.page.mouse
    mouse.move(*start)
    page.page.wait_for_timeout(300)
    mouse.down()
    mouse.move(*((start + end) / 2), steps=4)
    mouse.move(*end, steps=4)
    page.page.wait_for_timeout(200)
    mouse.up()
    page.until(lambda: page.pairs[0].scan != tuple(before.tolist()))
    moved = np.array(page.pairs[0].scan)
    assert abs(moved[1]) < 0.01  # still on the wall
    assert np.linalg.norm(moved - before - (0.4, 0.0, -0.2)) < 0.03
    view = page.viewer._view()
    page.page.keyboard.press("ArrowUp")
    page.until(lambda: page.pairs[0].scan != tuple(moved.tolist()))
    assert page.viewer._view() == view  # viser would turn it with the same key
    assert np.linalg.norm(np.array(page.pairs[0].scan) - moved) == pytest.approx(0.002, abs=1e-4)
    page.viewer.save("app-nudged")
