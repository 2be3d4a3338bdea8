"""The app in a headless browser against its targets: start, clicks, round trip, two browsers at once, six pairs.

On the sample scene where there is one, else on the small project of the tests. GAZELOC_BROWSER_GL=mesa draws faster.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from app_project import make_app_project
from data import CHECKOUT, SAMPLE_SCENES
from e2e.page import ViewerPage, chromium_path, launch
from gazeloc_app.actions.history import Undo
from gazeloc_app.app import App
from gazeloc_app.demo import demo_project
from gazeloc_app.keypoints.picking import pick_mesh
from gazeloc_app.tools.scan_point import ScanPointTool
from playwright.sync_api import Browser, sync_playwright

from gazeloc_core import pipeline
from gazeloc_core.arrays import Floats
from gazeloc_core.project import Project
from gazeloc_core.surfaces.raycast import Raycaster

Row = tuple[str, str, bool]
STUDIO = SAMPLE_SCENES / "studio"
SIZE = {"width": 1280, "height": 800}
_TIME_TO_NODE = """
name => {
  window.__took = null;
  addEventListener('pointerup', () => {
    const start = performance.now();
    const look = () => {
      if (window.__viserMutable.nodeRefFromName[name]) window.__took = performance.now() - start;
      else setTimeout(look, 0);
    };
    look();
  }, {capture: true, once: true});
}
"""


def bench_app(work: Path) -> list[Row]:
    """All targets of the app."""
    project = _project(work)
    path = chromium_path()
    rows: list[Row] = []
    if path is None:
        return [*rows, ("the app in a browser: not measured, no chromium is installed", "", False)]
    with sync_playwright() as playwright:
        browser = launch(playwright, str(path))
        rows.append(bench_start(browser, project, work))
        for bench in (bench_clicks, bench_round_trip, bench_two_browsers):
            with _app(project) as app:
                rows.append(bench(browser, app))
        browser.close()
    return rows


def bench_start(browser: Browser, project: Project, work: Path) -> Row:
    """Second start of the demo, from the command to the scan and the estimated cameras drawn; the browser is open."""
    command = ["demo"] if STUDIO.is_dir() else ["view", str(project.folder)]
    environment = os.environ | {"GAZELOC_DEMO": str(work), "PYTHONPATH": f"{CHECKOUT}:{CHECKOUT / 'app'}"}
    started = time.monotonic()
    process = subprocess.Popen(
        [sys.executable, "-m", "gazeloc_app", *command, "--port", "8471"],
        stdout=subprocess.PIPE,
        text=True,
        env=environment,
    )
    try:
        assert process.stdout is not None
        line = next(line for line in process.stdout if "http" in line)
        served = time.monotonic() - started
        address = next(word for word in line.split() if word.startswith("http"))
        viewer = ViewerPage(browser.new_context(viewport=SIZE).new_page()).open(address)
        viewer.wait_for_node("/scan").wait_for_node("/frusta/estimate").wait_until_drawn(1000)
        took = time.monotonic() - started
        viewer.page.context.close()
    finally:
        process.terminate()
        process.wait(20)
    text = f"{took:.1f} s (its address after {served:.1f} s), {_of(project)}"
    return "second start of the demo to the first complete frame <= 15 s", text, took <= 15


def bench_clicks(browser: Browser, app: App, count: int = 20) -> Row:
    """Clicks on the canvas from 3 m: the keypoint against the true surface point."""
    viewer = _open(browser, app)
    _take(viewer, app, ScanPointTool.name)
    (page,) = app.browsers.values()
    errors = []
    for point, eye in _targets(app, count):
        with page._client.atomic():
            page._client.camera.position = eye
            page._client.camera.look_at = point + np.array([0.1, 0.05, 0.0])
        _rest(viewer)
        before = len(app.store.state.annotation.keypoints)
        viewer.click_at_point(point)
        viewer.wait_until(lambda before=before: len(app.store.state.annotation.keypoints) > before)  # type: ignore[misc]
        errors.append(np.linalg.norm(np.array(app.store.state.annotation.keypoints.pairs[-1].scan) - point))
        viewer.page.wait_for_timeout(200)
    viewer.page.context.close()
    _undo_everything(app)
    text = f"worst {1000 * max(errors):.1f} mm, median {1000 * float(np.median(errors)):.1f} mm of {count}"
    return "click on the mesh from 3 m: error against the true surface point <= 1 cm", text, bool(max(errors) <= 0.01)


def bench_round_trip(browser: Browser, app: App, pairs: int = 40) -> Row:
    """Pointer up to the node in the page's scene: a keypoint against an empty callback that adds one node.

    In turns, by the very same gesture: for the empty one the callback's body is exchanged.
    """
    viewer = _open(browser, app)
    _take(viewer, app, ScanPointTool.name)
    target = _targets(app, 1, seed=5)[0][0]
    times: list[tuple[float, float]] = []
    for number in range(pairs + 3):
        order = ("app", "empty") if number % 2 else ("empty", "app")
        took = {which: _time_click(viewer, app, target + 0.004 * (number % 5), which) for which in order}
        times.append((took["app"], took["empty"]))
    viewer.page.context.close()
    ours, empty = np.array(times[3:]).T  # the first ones warm up
    ratio = float(np.median(ours / empty))
    text = f"{ratio:.2f} times (median of {pairs}; {np.median(ours):.0f} against {np.median(empty):.0f} ms)"
    return "round trip of a click against an empty callback on the same page <= 1.3", text, ratio <= 1.3


_EMPTY = "/empty"


def _time_click(viewer: ViewerPage, app: App, point: Floats, which: str) -> float:
    node = "/keypoints/k1/scan" if which == "app" else _EMPTY
    (page,) = app.browsers.values()
    if which == "empty":
        page.click = lambda click, **_: app.server.scene.add_icosphere(  # type: ignore[method-assign, assignment]
            _EMPTY, radius=0.035, color=(255, 0, 200), subdivisions=2, position=click.origin
        )
    viewer.settle()
    viewer.page.evaluate(_TIME_TO_NODE, node)
    viewer.click_at_point(point)
    viewer._wait("() => window.__took !== null", None, 30, polling_ms=20)
    took = float(viewer.page.evaluate("window.__took"))
    if which == "app":
        app.store.dispatch(Undo())
    else:
        del page.click
        app.server.scene.remove_by_name(_EMPTY)
    viewer.wait_for_node(node, present=False)
    viewer.page.wait_for_timeout(160)
    return took


def bench_two_browsers(browser: Browser, app: App, count: int = 300) -> Row:
    """Clicks and undos 200 ms apart, from two browsers at once: applied, in order, saved."""
    viewers = [_open(browser, app), _open(browser, app)]
    _take(viewers[0], app, ScanPointTool.name)
    targets = [point for point, _ in _targets(app, 24, seed=7, from_start=viewers[0])]
    viewers[0].page.wait_for_timeout(500)
    applied, sent = app.store.applied, []
    start = time.monotonic()
    last = [start, start]
    for number in range(count):
        viewer = viewers[number % 2]
        while time.monotonic() < last[number % 2] + 0.2:
            viewer.page.wait_for_timeout(5)
        last[number % 2] = time.monotonic()
        if number % 10 == 9:
            viewer.page.keyboard.press("Control+z")
            sent.append("Undo")
        else:
            viewer.click_at_point(targets[number % len(targets)])
            sent.append("PickPoint")
    took = time.monotonic() - start
    end = time.monotonic() + 20
    while app.store.applied < applied + count and time.monotonic() < end:
        viewers[0].page.wait_for_timeout(50)
    viewers[0].page.wait_for_timeout(300)
    state, done = app.store.state, app.store.applied - applied
    expected = sent.count("PickPoint") - sent.count("Undo")
    is_saved = app.project.keypoints(state.recording) == state.annotation.keypoints
    is_right = done == count and len(state.annotation.keypoints) == expected and is_saved
    for viewer in viewers:
        viewer.page.context.close()
    _undo_everything(app)
    text = f"{done} of {count} applied in {took:.0f} s, {len(state.annotation.keypoints)} of {expected} pairs, "
    return (
        f"{count} clicks and undos from two browsers at once",
        text + ("saved" if is_saved else "NOT SAVED"),
        is_right,
    )


def _project(work: Path) -> Project:
    """The demo's project after its first start, or the small one of the tests; aligned."""
    if STUDIO.is_dir():
        (work / "gazeloc").mkdir()
        project = demo_project(work / "gazeloc")
    else:
        project = make_app_project(work / "small")
    pipeline.run(project)
    return project


@contextmanager
def _app(project: Project) -> Iterator[App]:
    app = App(project, port=0)
    app.start()
    try:
        yield app
    finally:
        app.stop()


def _open(browser: Browser, app: App) -> ViewerPage:
    viewer = ViewerPage(browser.new_context(viewport=SIZE).new_page()).open(app.address)
    return viewer.wait_for_node("/scan").wait_until_drawn(300).wait_for_clicks()


def _take(viewer: ViewerPage, app: App, name: str) -> None:
    for page in app.browsers.values():
        page._choice.value, page._snap.value = name, False
    viewer.page.wait_for_timeout(300)


def _rest(viewer: ViewerPage) -> None:
    before = None
    while before is None or np.abs(before - viewer.project([[0, 0, 0], [1, 1, 1]])).max() > 1e-6:
        before = viewer.project([[0, 0, 0], [1, 1, 1]])
        viewer.page.wait_for_timeout(250)


def _is_at_an_edge(raycaster: Raycaster, eye: Floats, point: Floats, front: int, rng: np.random.Generator) -> bool:
    """Whether a click some pixels beside the point meets a hole of the scan or something else: nobody aims there."""
    distance = float(np.linalg.norm(point - eye))
    beside = [pick_mesh(raycaster, eye, point + 0.01 * distance * rng.normal(size=3) - eye, front) for _ in range(12)]
    return any(hit is None or np.linalg.norm(hit - point) > 0.1 * distance for hit in beside)


def _targets(app: App, count: int, seed: int = 3, from_start: ViewerPage | None = None) -> list[tuple[Floats, Floats]]:
    """Points of the surface and eyes 3 m away (or the opening view's eye) that see them."""
    rng = np.random.default_rng(seed)
    mesh, raycaster, front = app.data.mesh(), app.data.raycaster(), app.scene.front
    found: list[tuple[Floats, Floats]] = []
    while len(found) < count:
        face = mesh.vertices[mesh.faces[rng.integers(len(mesh.faces))]]
        point = rng.dirichlet((1, 1, 1)) @ face
        normal = np.cross(face[1] - face[0], face[2] - face[0])
        normal = normal / max(float(np.linalg.norm(normal)), 1e-12) * (front or 1)
        aside = rng.normal(size=3)
        direction = normal + 0.5 * aside / np.linalg.norm(aside)
        eye = point + 3.0 * direction / np.linalg.norm(direction)
        if from_start is not None or count == 1:
            eye = np.array(app.server.initial_camera.position)
        hit = pick_mesh(raycaster, eye, point - eye, front)
        if hit is None or np.linalg.norm(hit - point) > 1e-3 or _is_at_an_edge(raycaster, eye, point, front, rng):
            continue
        if from_start is not None and not _is_on_canvas(from_start, point):
            continue
        found.append((point, eye))
    return found


def _is_on_canvas(viewer: ViewerPage, point: Floats) -> bool:
    x, y = viewer.project(point)[0]
    box = viewer.page.locator("canvas").first.bounding_box()
    assert box is not None
    is_inside = box["x"] + 450 < x < box["x"] + box["width"] - 420 if box["width"] > 1000 else True
    return bool(is_inside and 80 < y < SIZE["height"] - 20 and 450 < x < SIZE["width"] - 420)


def _undo_everything(app: App) -> None:
    while app.store.state.past:
        past = len(app.store.state.past)
        app.store.dispatch(Undo())
        end = time.monotonic() + 5
        while len(app.store.state.past) >= past and time.monotonic() < end:
            time.sleep(0.005)


def _of(project: Project) -> str:
    return "the sample scene" if STUDIO.is_dir() else "the small project of the tests"
