"""The app's looks in a real browser: the dark that a browser remembers, and panels that fit."""

from dataclasses import replace

import numpy as np
import pytest
from app_project import make_app_project
from e2e.app_page import AppPage
from gazeloc_app.app import App
from gazeloc_app.tools.tape import TapeTool

pytestmark = pytest.mark.e2e
SCHEME = "() => document.documentElement.getAttribute('data-mantine-color-scheme')"
LOGO = "() => document.querySelector('img[alt=GazeLoc]').naturalWidth"
CANVAS = "() => window.__viserMutable.canvas.getBoundingClientRect().width"

TABS = """() => {
  const tabs = [...document.querySelectorAll('[role=tablist]')].find((list) => list.children.length === 8).children;
  const boxes = Array.from(tabs, (tab) => tab.getBoundingClientRect());
  return boxes.map((box) => [box.left, box.top, box.width].map(Math.round));
}"""


@pytest.fixture
def app(tmp_path):
    app = App(make_app_project(tmp_path), port=0)
    app.start()
    yield app
    app.stop()


def test_the_dark_is_remembered_and_a_tablet_keeps_room_for_the_scene(app, open_page):
    viewer = open_page(app.address, width=1024, height=768).wait_until_drawn(300)
    page = AppPage(viewer, app)
    assert viewer.page.evaluate(LOGO) > 0
    assert viewer.page.evaluate(SCHEME) == "light"
    viewer.wait_until(lambda: viewer.page.evaluate(CANVAS) > 330)
    left, top, width = np.array(viewer.page.evaluate(TABS)).T
    assert len(set(left)) == 4, "eight tabs in two rows of four, all of one width"
    assert len(set(top)) == 2
    np.testing.assert_allclose(width, width[0], atol=1)
    page.tab("Help").press("Light or dark")
    viewer.wait_until(lambda: viewer.page.evaluate(SCHEME) == "dark")
    viewer.open(app.address).wait_until_drawn(300)
    viewer.wait_until(lambda: viewer.page.evaluate(SCHEME) == "dark")
    viewer.page.mouse.move(512, 400)
    viewer.page.mouse.wheel(0, 4000)  # away from the room, so that there is ground beside it
    viewer.wait_until(lambda: viewer.canvas_pixels()[40, 40].max() < 60)
    color = "() => getComputedStyle(document.querySelector('.gazeloc-card')).backgroundColor"
    assert viewer.page.evaluate(color) == "rgb(29, 48, 56)"
    viewer.save("app-dark")


def test_a_project_without_a_recording_has_a_page_with_the_room_and_what_to_do_first(tmp_path, open_page):
    project = make_app_project(tmp_path)
    project.save(replace(project.settings, recordings={}))
    app = App(project, port=0)
    app.start()
    try:
        viewer = open_page(app.address).wait_until_drawn(300)
        page = AppPage(viewer, app)
        assert viewer.page.get_by_text("No recording yet.").is_visible()
        assert viewer.page.get_by_role("tab").all_inner_texts() == ["Help", "Project", "Layers", "History"]
        page.tab("Layers").press("Save this view")
        page.until(lambda: len(page.state.annotation.views) == 1)
        page.choose("A click", TapeTool.name)
        viewer.click_at_point((1.7, 1.6, 0.0))
        viewer.wait_for_node("/tape/0")
        viewer.click_at_point((2.2, 1.6, 0.0))
        viewer.wait_for_node("/tape/line")
    finally:
        app.stop()
