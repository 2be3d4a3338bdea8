"""Several people and one that was away: names, coming back to the same view, history by clicks, jobs without a page."""

from __future__ import annotations

import time

import job_tasks
import numpy as np
import pytest
from e2e.app_page import AppPage
from e2e.page import ViewerPage
from gazeloc_app.actions.choices import ChooseAlignment
from gazeloc_app.actions.jobs import StartJob
from gazeloc_app.actions.picks import PickPoint, Side
from gazeloc_app.app import App
from gazeloc_app.work import tasks

from gazeloc_core.project import Project

pytestmark = pytest.mark.e2e

SIZE = {"width": 1360, "height": 760}
CORNERS = [[0, 0, 0], [4, 3, 2.6]]
WALK = (("recording", "walk"),)


@pytest.fixture
def open_app(app, open_page):
    def open_app() -> AppPage:
        return AppPage(open_page(app.address, **SIZE).wait_until_drawn(300).wait_for_clicks(), app)

    return open_app


def orbit(viewer: ViewerPage) -> np.ndarray:
    """Turn the view by hand; where two corners of the room are then."""
    mouse = viewer.page.mouse
    mouse.move(640, 400)
    mouse.down()
    mouse.move(760, 430, steps=6)
    mouse.up()
    return rest(viewer)


def rest(viewer: ViewerPage) -> np.ndarray:
    before = None
    while before is None or np.abs(before - viewer.project(CORNERS)).max() > 0.01:
        before = viewer.project(CORNERS)
        viewer.page.wait_for_timeout(300)
    return before


def tool_names(page):
    return tuple(next(iter(page.app.browsers.values()))._tools)


def selected_tab(page):
    return page.page.locator("[role=tab][aria-selected=true]").first.inner_text()


def test_a_reload_comes_back_to_the_same_camera_tool_tab_and_wipe(open_app):
    page = open_app()
    start = page.viewer.project(CORNERS)
    turned = orbit(page.viewer)
    assert np.abs(turned - start).max() > 20
    tool = tool_names(page)[1]
    page.choose("A click", tool).tab("Layers")
    page.page.get_by_label("Wipe").fill("20")
    page.page.wait_for_timeout(300)
    page.page.reload()
    page.viewer.wait_until_drawn(300).wait_for_clicks()
    page.viewer.wait_until(lambda: np.abs(rest(page.viewer) - turned).max() < 1.5)
    assert page.field("A click").input_value() == tool
    page.viewer.wait_until(lambda: "Layers" in page.page.locator("[role=tab][aria-selected=true]").all_inner_texts())
    page.viewer.wait_until(lambda: page.page.get_by_label("Wipe").input_value() == "20")
    page.viewer.save("people-reloaded")


def test_two_people_see_each_others_names_and_keypoints_and_keep_their_own_camera(open_app):
    first, second = open_app(), open_app()
    first.viewer.wait_until(lambda: len(first.state.people) == 2)
    name = first.page.get_by_label("Your name")
    name.fill("Anna <b>")
    name.press("Enter")
    second.page.locator(".gazeloc-people").get_by_text("Anna <b>").wait_for()
    still = second.viewer.project(CORNERS)
    orbit(first.viewer)
    assert np.abs(second.viewer.project(CORNERS) - still).max() < 0.01
    second.viewer.wait_for_node("/people/1")
    there = rest(first.viewer)
    second.viewer.save("people-onlooker")
    second.page.get_by_title("Go to what Anna <b> sees").click()
    second.viewer.wait_until(lambda: np.abs(rest(second.viewer) - there).max() < 1.5)
    second.viewer.wait_for_node("/people/1", present=False)  # now at the same place
    first.choose("A click", tool_names(first)[-1])
    second.page.locator(".gazeloc-person").get_by_text(tool_names(first)[-1]).wait_for()
    first.app.store.dispatch(PickPoint(Side.SCAN, (1.5, 0.0, 1.9)))
    for page in (first, second):
        page.viewer.wait_for_node("/keypoints/k1/scan")
    second.viewer.save("people-two")
    first.page.close()
    second.viewer.wait_until(lambda: len(second.state.people) == 1)
    second.page.locator(".gazeloc-people").get_by_text("Anna").wait_for(state="detached")


def test_when_the_server_is_gone_the_page_says_so_and_comes_back_to_the_same_view_by_itself(project, open_page):
    app = App(project, port=0)
    app.start()
    port = app.server.get_port()
    viewer = open_page(app.address, **SIZE).wait_until_drawn(300).wait_for_clicks()
    viewer.wait_until(lambda: bool(app.store.state.people))
    turned = orbit(viewer)
    app.store.dispatch(PickPoint(Side.SCAN, (1.5, 0.0, 1.9)))
    viewer.wait_for_node("/keypoints/k1/scan")
    viewer.page.wait_for_timeout(1500)
    app.stop()
    banner = viewer.page.locator("#gazeloc-banner")
    banner.wait_for(timeout=20_000)
    assert "does not answer" in banner.inner_text()
    viewer.save("people-server-gone")
    again = App(Project.open(project.folder), port=port)
    again.start()
    try:
        banner.wait_for(state="detached", timeout=40_000)
        viewer.wait_until(lambda: bool(again.store.state.people), 40)
        viewer.wait_until_drawn(300).wait_for_node("/keypoints/k1/scan")
        viewer.wait_until(lambda: np.abs(rest(viewer) - turned).max() < 1.5)
        assert len(again.store.state.past) == 1
        viewer.errors = [error for error in viewer.errors if "ERR_CONNECTION" not in error and "WebSocket" not in error]
    finally:
        viewer.page.goto("about:blank")
        again.stop()


def test_a_click_in_the_history_goes_to_that_step_and_keys_go_on(open_app, project):
    page = open_app()
    for number in range(3):
        page.app.store.dispatch(PickPoint(Side.SCAN, (1.0 + number, 0.0, 1.5)))
        page.app.store.dispatch(PickPoint(Side.SFM, (0.1 * number, 0.2, 0.3)))
    page.app.store.dispatch(ChooseAlignment(None))
    page.tab("History")
    page.page.get_by_text("Keypoint 3 placed on the scan").wait_for()
    page.viewer.save("people-history")
    page.page.get_by_text("Keypoint 2 placed on the scan").click()
    page.until(lambda: len(page.pairs) == 2 and page.pairs[1].sfm is None)
    page.viewer.wait_until(lambda: project.keypoints("walk").pairs == page.pairs)
    page.viewer.wait_for_node("/keypoints/k3/scan", present=False)
    page.page.mouse.move(640, 400)
    page.page.keyboard.press("Control+Shift+z")
    page.until(lambda: page.pairs[1].sfm is not None)
    page.page.keyboard.press("Control+z")
    page.until(lambda: page.pairs[1].sfm is None)


def test_a_job_goes_on_without_a_page_and_one_that_waits_can_be_taken_off(open_app, open_page):
    page = open_app()
    keywords = (*WALK, ("formats", ("csv",)), ("output", str(page.app.project.folder / "out")))
    for action in (StartJob("Align", job_tasks.align_when_told, WALK), StartJob("Export", tasks.export, keywords)):
        page.app.store.dispatch(action)
    page.page.get_by_text("waits: Export").wait_for()
    page.viewer.save("people-jobs")
    button = page.page.get_by_label("Take off Export").bounding_box()
    page.page.mouse.move(button["x"] + button["width"] / 2, button["y"] + button["height"] / 2)
    page.page.mouse.down()
    page.app.store.dispatch(StartJob("Refine", tasks.refine, (*WALK, ("start", "c0ffee"))))
    page.page.get_by_text("waits: Refine").wait_for()  # the list is made anew between press and release
    page.page.mouse.up()
    page.viewer.wait_until(lambda: [job.name for job in page.state.waiting_jobs] == ["Refine"])
    page.page.get_by_label("Take off Refine").click()
    page.viewer.wait_until(lambda: not page.state.waiting_jobs)
    page.page.close()
    (page.app.project.folder / job_tasks.GO).touch()
    end = time.monotonic() + 120
    while page.state.job is not None and time.monotonic() < end:
        time.sleep(0.1)
    assert page.state.annotation.alignment is not None
    again = open_app()
    again.page.get_by_text("Aligned: keypoints").locator("visible=true").first.wait_for()
    again.page.get_by_text("What the jobs said").click()
    again.page.locator("details summary").get_by_text("Align", exact=True).first.wait_for()
    again.page.wait_for_timeout(500)  # the folder unfolds
    again.viewer.save("people-job-done")
