"""Checking by eye in a real browser: each way to compare, the timeline, keys, and what outlasts a reload."""

from __future__ import annotations

import numpy as np
import pytest
from app_project import make_app_project
from e2e.app_page import AppPage
from gazeloc_app.actions.views import ShowFrame
from gazeloc_app.app import App

from gazeloc_core.marks import Mark
from gazeloc_core.methods import Method
from gazeloc_core.pipeline import run_after_choice
from gazeloc_core.project import Chosen
from gazeloc_core.stages.registration import align_keypoints

pytestmark = pytest.mark.e2e


@pytest.fixture
def app(tmp_path):
    project = make_app_project(tmp_path)
    alignment = align_keypoints(project, "walk")
    project.choose("walk", Chosen(alignment=alignment.key, by_person=True))
    run_after_choice(project, "walk", Method.SFM)
    app = App(project, port=0)
    app.start()
    yield app
    app.stop()


@pytest.fixture
def page(app, open_page):
    return AppPage(open_page(app.address, width=1200, height=900), app)


def shown(page, frame):
    page.page.wait_for_selector(f'.gazeloc-stage[data-shown="{frame}"][data-quality="whole"]', timeout=60_000)


def show(page, frame):
    page.app.store.dispatch(ShowFrame(frame))
    shown(page, frame)


def mode(page, name):
    page.page.get_by_role("radio", name=name, exact=True).click()


def style(page, selector, name):
    return page.page.evaluate(f"getComputedStyle(document.querySelector('{selector}')).{name}")


def test_ways_to_compare_are_this_browsers_own_and_outlast_frames_and_a_reload(page):
    show(page, 4)
    mode(page, "Difference")
    assert style(page, ".gazeloc-stage img.gazeloc-render", "mixBlendMode") == "difference"
    mode(page, "Edges")
    pink = "() => [...document.querySelector('.gazeloc-edges').getContext('2d').getImageData(0, 0, 400, 300).data]"
    alpha = np.array(page.page.evaluate(pink))[3::4]
    assert 0.005 < (alpha > 0).mean() < 0.2
    mode(page, "Side by side")
    show(page, 6)
    page.page.reload()
    shown(page, 6)
    frame, render = (page.page.locator(f".gazeloc-stage img[alt={alt}]").bounding_box() for alt in ("frame", "render"))
    assert render["x"] >= frame["x"] + frame["width"]
    page.viewer.save("checking-beside")


def test_dragging_over_the_picture_wipes(page):
    show(page, 4)
    mode(page, "Wipe")
    box = page.page.locator(".gazeloc-stage").bounding_box()
    page.page.mouse.click(box["x"] + 0.25 * box["width"], box["y"] + 50)
    assert style(page, ".gazeloc-stage img.gazeloc-render", "clipPath") == "inset(0px 0px 0px 25%)"


def test_the_original_lens_shows_both_pictures_in_the_recordings_shape(page):
    show(page, 4)
    page.page.get_by_label("Original lens").check()
    sizes = "() => ['frame', 'render'].map(a => document.querySelector(`.gazeloc-stage img.gazeloc-${a}`))"
    page.page.wait_for_function(f"() => ({sizes})().every(i => i && i.src.includes('lens=1'))")
    shown(page, 4)
    lens = page.app.data.recording("walk").camera
    for width, height in page.page.evaluate(f"() => ({sizes})().map(i => [i.naturalWidth, i.naturalHeight])"):
        assert (width, height) == (lens.width, lens.height)


def test_keys_mark_step_and_play_and_a_click_in_the_timeline_goes_there(page):
    show(page, 4)
    page.page.keyboard.press("b")
    page.until(lambda: page.state.annotation.marks.get(4) is not None)
    assert page.state.annotation.marks.get(4).mark is Mark.BAD
    page.page.keyboard.press("l")
    page.until(lambda: page.state.frame == 5)
    page.page.keyboard.press("n")
    page.until(lambda: page.state.frame != 5)
    line = page.page.locator(".gazeloc-timeline").bounding_box()
    page.page.mouse.click(line["x"] + 0.2 * line["width"], line["y"] + 5)
    page.until(lambda: page.state.frame == 3)
    shown(page, 3)
    page.page.keyboard.press("Space")
    page.until(lambda: page.state.frame > 5)
    page.page.keyboard.press("Space")
    page.until(lambda: not page.state.is_playing)
    shown(page, page.state.frame)
