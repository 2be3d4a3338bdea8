"""Checking by eye in a real browser: each way to compare, the timeline, keys, and what outlasts a reload."""

from __future__ import annotations

import numpy as np
import pytest
from app_project import make_app_project, with_poses
from e2e.app_page import AppPage
from gazeloc_app.actions.views import CompareWith, ShowFrame

from gazeloc_core.frames.marks import Mark

pytestmark = pytest.mark.e2e


@pytest.fixture
def project(tmp_path):
    return with_poses(make_app_project(tmp_path))


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


def slide(page, frame):
    page.field("Frame").fill(str(frame))


def number_of_picture(page, place):
    return int(
        page.page.locator(f".gazeloc-stage img.gazeloc-{place}").get_attribute("src").rpartition("/")[2].split(".")[0]
    )


def test_a_frame_that_was_seen_shows_before_the_app_answers_and_goes_again_where_it_never_does(page):
    show(page, 4)
    show(page, 6)
    held = []
    page.page.route("**/show/**", lambda route: held.append(route))
    slide(page, 4)
    assert page.page.locator(".gazeloc-stage").get_attribute("data-shown") == "4"
    assert (number_of_picture(page, "frame"), number_of_picture(page, "render")) == (4, 4)
    assert page.page.locator(".gazeloc-number").inner_text() == "frame 4"
    assert page.state.frame == 6
    shown(page, 6)  # the app still shows another one: so does the page, after a while
    assert page.field("Frame").input_value() == "6"
    held[0].fulfill(status=204)


def test_what_is_shown_is_one_frame_with_its_own_render_and_number_however_quick_the_moves(page):
    show(page, 2)
    page.page.evaluate("""() => {
      window.__mixed = [];
      const stage = document.querySelector('.gazeloc-stage');
      new MutationObserver(() => {
        const numbers = [...stage.querySelectorAll('img')].slice(0, 2).map((i) => i.src.match(/([0-9]+)[.]jpg/)[1]);
        const all = [...numbers, stage.dataset.shown, stage.querySelector('.gazeloc-number').textContent.split(' ')[1]];
        if (new Set(all).size > 1) window.__mixed.push(all.join());
      }).observe(stage, {attributes: true, attributeFilter: ['data-shown']});
    }""")
    for frame in (0, 8, 4, 14, 2, 12, 10):
        slide(page, frame)
    shown(page, 10)
    page.until(lambda: page.state.frame == 10)
    assert page.page.evaluate("window.__mixed") == []


def test_two_people_who_scrub_at_once_end_at_one_frame(page, open_page):
    other = AppPage(open_page(page.app.address, width=1000, height=700), page.app)
    for one in (page, other):
        shown(one, page.state.frame)
    for mine, theirs in ((2, 14), (4, 12), (6, 10)):
        slide(page, mine)
        slide(other, theirs)
    page.page.wait_for_timeout(1500)
    for one in (page, other):
        shown(one, page.state.frame)
        assert one.field("Frame").input_value() == str(page.state.frame)
    other.page.reload()
    shown(other, page.state.frame)


_DRAW_SLOWLY = """() => {
  const scene = window.__viserMutable.scene, before = scene.onBeforeRender;
  window.__draws = 0;
  scene.onBeforeRender = function (...all) {
    before.apply(this, all);
    window.__draws += 1;
    const end = performance.now() + 150;
    while (performance.now() < end);
  };
}"""
_MOVE_ON_END = """async (frames) => {
  const before = window.__draws;
  for (const frame of frames) {
    window.gazelocScrub.go(frame);
    await new Promise((done) => setTimeout(done, 80));
  }
  return window.__draws - before;
}"""


def test_a_view_that_is_slow_to_draw_waits_while_frames_are_gone_through_and_follows_then(page):
    show(page, 4)
    page.page.evaluate(_DRAW_SLOWLY)
    page.page.wait_for_function("() => window.gazelocView.paceMs() > 120", timeout=60_000)
    draws = page.page.evaluate(_MOVE_ON_END, [2, 6, 8, 10, 12, 14, 8, 6, 2, 4, 10, 12])
    assert draws <= 2  # 4 where it does not wait
    shown(page, 12)
    seen = page.page.evaluate("window.__draws")
    camera = page.app.data.trajectory("walk", page.app.data.poses_key("walk", page.state.annotation)).pose(12)
    page.page.wait_for_function(
        """([x, y, z]) => {
          const camera = window.__viserMutable.nodeRefFromName['/selected'];
          const at = camera ? camera.position : {};
          return Math.hypot(at.x - x, at.y - y, at.z - z) < 1e-3;
        }""",
        arg=camera.translation.tolist(),
        timeout=60_000,
    )
    page.page.wait_for_function(f"() => window.__draws > {seen}", timeout=60_000)


def test_a_frame_that_cannot_be_read_says_so_where_its_picture_would_be(page):
    path = page.app.data.recording("walk").path / "f_003.png"
    path.write_bytes(path.read_bytes()[:300])
    slide(page, 3)
    page.page.locator(".gazeloc-said", has_text="f_003.png").wait_for(timeout=60_000)
    page.viewer.save("checking-unreadable")
    slide(page, 4)
    shown(page, 4)
    assert page.page.locator(".gazeloc-said").inner_text() == ""
    page.viewer.errors[:] = [error for error in page.viewer.errors if "404" not in error]  # the browser names those too


def test_the_number_field_goes_to_a_frame_and_refuses_what_is_none(page):
    show(page, 4)
    field = page.page.get_by_label("Frame's number")
    field.fill("9")
    field.press("Enter")
    page.until(lambda: page.state.frame == 9)
    field.fill("999")
    field.press("Enter")
    page.until(lambda: page.state.frame == len(page.app.data.recording("walk")) - 1)


def test_two_renders_stand_below_the_frame_also_where_they_are_the_very_same(page):
    show(page, 4)
    page.app.store.dispatch(CompareWith(page.state.annotation.alignment))
    mode(page, "A | B")
    page.page.wait_for_selector(".gazeloc-stage img.gazeloc-other", timeout=60_000)
    show(page, 6)
    boxes = [
        page.page.locator(f".gazeloc-stage img.gazeloc-{place}").bounding_box()
        for place in ("frame", "render", "other")
    ]
    assert boxes[1]["y"] == boxes[2]["y"] >= boxes[0]["y"] + boxes[0]["height"]
    assert boxes[2]["x"] >= boxes[1]["x"] + boxes[1]["width"]
    assert (number_of_picture(page, "render"), number_of_picture(page, "other")) == (6, 6)
    page.viewer.save("checking-two")
