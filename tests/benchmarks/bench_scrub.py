"""Scrubbing in a headless browser: from the slider to both pictures on screen, and whether the last one is shown."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
from e2e.app_page import AppPage
from e2e.page import ViewerPage
from gazeloc_app.app import App
from playwright.sync_api import Browser, TimeoutError

Row = tuple[str, str, bool]
NEVER_MS = 15_000.0
"""What was not shown by then counts as that long."""
SIZE = {"width": 1280, "height": 900}
_WATCH = """
(wanted) => {
  const took = (window.__scrub = {});
  const painted = (then) => requestAnimationFrame(() => requestAnimationFrame(then)); // the next one comes after it
  addEventListener('input', (event) => {
    if (event.target.value !== wanted) return;
    const stage = document.querySelector('.gazeloc-stage');
    const look = () => {
      if (stage.dataset.shown !== wanted) return;
      const name = stage.dataset.quality;
      const images = [...stage.querySelectorAll('img')].slice(0, 2);
      const isThere = images.length === 2 && images.every((image) => image.complete && image.naturalWidth > 0);
      if (isThere && !took[name]) {
        took[name] = -1;
        painted((now) => (took[name] = performance.now() - event.timeStamp));
      }
    };
    new MutationObserver(look).observe(stage, {attributes: true});
    look();
  }, {capture: true});
}
"""
"""From the slider's event, as the browser stamped it, to the frame after the one that has both pictures in it."""


def bench_scrub(browser: Browser, app: App, count: int = 12) -> list[Row]:
    """Frames that no cache has, the same ones again, and quick moves."""
    viewer = ViewerPage(browser.new_context(viewport=SIZE).new_page()).open(app.address)
    page = viewer.page
    page.wait_for_selector(".gazeloc-stage[data-shown]", timeout=120_000)
    frames = _frames_with_poses(app, count)
    _time(viewer, frames[0], 0)  # the first one opens the video and the renderer
    page.wait_for_timeout(4000)
    fresh = [_time(viewer, frame, 3000) for frame in frames[1:]]  # until it has looked ahead
    again = [_time(viewer, frame, 100) for frame in frames[1:]]  # the 3D view is drawn anew meanwhile
    at_rest = [_time(viewer, frame, 2000) for frame in frames[1:]]
    rows = [
        _row("cached, moves on end", 60, [times["whole"] for times in again], app),
        _row("cached, one move at a time", 60, [times["whole"] for times in at_rest[1:]], app),
        _row("not cached, small pictures first", 400, [min(times.values()) for times in fresh], app),
        _row("not cached, pictures in full", 400, [times["whole"] for times in fresh], app),
        _quick(viewer, app),
    ]
    page.context.close()
    return rows


def _row(name: str, limit_ms: int, times_ms: list[float], app: App) -> Row:
    camera = app.data.recording(app.store.state.recording).camera
    median, worst = float(np.median(times_ms)), max(times_ms)
    what = f"scrubbing at {camera.width}x{camera.height}, {name}: slider to both pictures <= {limit_ms} ms"
    return what, f"median {median:.0f} ms, worst {worst:.0f} ms of {len(times_ms)}", median <= limit_ms


def _quick(viewer: ViewerPage, app: App, moves: int = 30) -> Row:
    """Moves 40 ms apart to frames far apart; then the last one, and nothing after it."""
    rng, page = np.random.default_rng(1), viewer.page
    frames = _frames_with_poses(app, 400)
    targets = rng.choice(frames, moves, replace=False).tolist()
    for frame in targets:
        page.evaluate("frame => window.gazelocScrub.go(frame)", frame)
        page.wait_for_timeout(40)
    started = page.evaluate("performance.now()")
    shown = f'.gazeloc-stage[data-shown="{targets[-1]}"]'
    try:
        page.wait_for_selector(shown, timeout=15_000)
        took = float(page.evaluate("performance.now()")) - started
        page.wait_for_timeout(1500)
        is_last = page.locator(shown).count() == 1
    except TimeoutError:
        return f"{moves} quick moves: the last one is shown", "never", False
    return f"{moves} quick moves: the last one is shown", f"{took:.0f} ms after the last move", is_last


def _time(viewer: ViewerPage, frame: int, rest_ms: int) -> dict[str, float]:
    """Moves the slider; when both pictures were painted, in ms: `whole`, and `quick` where small ones came first."""
    box = AppPage(viewer, None).field("Frame")
    viewer.page.evaluate(_WATCH, str(frame))
    box.fill(str(frame))
    with suppress(TimeoutError):
        viewer.page.wait_for_function("() => window.__scrub.whole > 0", timeout=NEVER_MS, polling=200)
    viewer.page.wait_for_timeout(rest_ms)
    took: dict[str, float] = viewer.page.evaluate("window.__scrub")
    return {"whole": NEVER_MS} | {name: ms for name, ms in took.items() if ms > 0}


def _frames_with_poses(app: App, count: int) -> list[int]:
    state = app.store.state
    trajectory = app.data.trajectory(state.recording, app.data.poses_key(state.recording, state.annotation))
    assert trajectory is not None
    known = np.flatnonzero(trajectory.has_pose)
    return [int(frame) for frame in known[np.linspace(10, len(known) - 10, min(count, len(known) - 20)).astype(int)]]
