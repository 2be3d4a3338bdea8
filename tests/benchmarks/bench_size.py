"""The scene at size in a headless browser, against a page with nothing but our own unlit GLB of the same display mesh.

Both pages are opened in turns in one browser, so that their ratio holds on a busy machine.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from e2e.page import ViewerPage, chromium_path, launch
from gazeloc_app.actions.choices import CompareMethod
from gazeloc_app.actions.views import ThinCameras
from gazeloc_app.app import App
from gazeloc_app.routes import Routes
from gazeloc_app.scene.cloud import MAX_POINTS
from gazeloc_app.scene.frusta import FEW_EDGES
from gazeloc_app.scene.room import RoomLayer
from gazeloc_app.scene.view import set_start
from gazeloc_app.server import make_server
from playwright.sync_api import Browser, sync_playwright
from size_project import FRAMES, POINTS, TRIANGLES, make_size_project

from gazeloc_core.methods import Method
from gazeloc_core.stages.display import load_display, make_display
from gazeloc_core.surfaces.scan_display import ScanDisplay

Row = tuple[str, str, bool]
SIZE = {"width": 1280, "height": 800}
ROUNDS = 3
ORBIT_S = 5.0
NODES = ("/scan", "/sfm/cloud", "/frusta/truth", "/frusta/estimate", "/frusta/methods/tags-paper")
_HAS_DRAWN = """
([names, triangles, lines, points]) => {
  const m = window.__viserMutable, t = window.__viserTestpoints;
  if (!m || !t || !t.rendererInfo || !names.every(name => m.nodeRefFromName[name])) return false;
  const drawn = t.rendererInfo.render;
  return drawn.triangles >= triangles && drawn.lines >= lines && drawn.points >= points;
}
"""
_ORBIT = """
seconds => new Promise(done => {
  const m = window.__viserMutable, info = window.__viserTestpoints.rendererInfo.render;
  const start = performance.now(), first = info.frame;
  const turn = () => {
    const passed = (performance.now() - start) / 1000;
    if (passed >= seconds) { done((info.frame - first) / passed); return; }
    m.cameraControl.rotate(0.03, 0, false);
    m.requestRender();
    requestAnimationFrame(turn);
  };
  turn();
})
"""


def bench_size(work: Path) -> list[Row]:
    """First frame, frames per second and heap."""
    path = chromium_path()
    if path is None:
        return [("the scene at size: not measured, no chromium is installed", "", False)]
    project = make_size_project(work)
    rows = [_timed_display(lambda: make_display(project))]
    display = load_display(project)
    assert display is not None
    app = App(project, port=0)
    app.start()
    app.store.dispatch(CompareMethod(Method.TAGS_PAPER, True))
    app.store.dispatch(ThinCameras(1))
    try:
        with _mesh_alone(app, display) as alone, sync_playwright() as playwright:
            browser = launch(playwright, str(path))
            rows += _compare(browser, app.address, alone, display.faces)
            browser.close()
    finally:
        app.stop()
    return rows


def _timed_display(make: Callable[[], ScanDisplay]) -> Row:
    start = time.monotonic()
    display = make()
    text = f"{time.monotonic() - start:.1f} s, {display.faces:,} of {display.faces_of_scan:,} triangles"
    return f"once per scan, beside the app: {TRIANGLES:,} triangles made fit for the screen", text, True


def _compare(browser: Browser, address: str, alone: str, faces: int) -> list[Row]:
    first, filled, rates, heaps = [], [], [], []
    whole = (list(NODES), faces, 3 * FRAMES * len(FEW_EDGES), MAX_POINTS)
    for _ in range(ROUNDS):
        ours, viewer = _open(browser, address, whole)
        filled.append(ours + _until_panels_are_filled(viewer))
        viewer.wait_until_drawn(1)
        rate, heap = _orbit(viewer), _heap_mb(viewer)
        viewer.page.context.close()
        theirs, viewer = _open(browser, alone, (["/scan"], faces, 0, 0))
        viewer.wait_until_drawn(1)
        first.append((ours, theirs))
        rates.append((rate, _orbit(viewer)))
        heaps.append(heap)
        viewer.page.context.close()
    what = f"{TRIANGLES:,} triangles, {POINTS:,} points, 3 x {FRAMES:,} cameras"
    (ours, theirs), (rate, its_rate) = np.median(first, axis=0), np.median(rates, axis=0)
    late, slow = (float(np.median(np.divide(*np.transpose(pairs)))) for pairs in (first, rates))
    heap = float(np.median(heaps))
    return [
        (
            f"{what}: first complete frame <= 2 x the mesh alone",
            f"{late:.2f} times ({ours:.1f} against {theirs:.1f} s)",
            late <= 2,
        ),
        ("the same: panels filled, which waits for that frame", f"{float(np.median(filled)):.1f} s", True),
        (
            "the same: frames per second while orbiting, detail spared as a slow page does, >= 0.5 x",
            f"{slow:.2f} times ({rate:.2f} against {its_rate:.2f})",
            slow >= 0.5,
        ),
        ("the same: heap of the browser, buffers included <= 400 MB", f"{heap:.0f} MB", heap <= 400),
    ]


def _open(browser: Browser, address: str, wanted: tuple[Any, ...]) -> tuple[float, ViewerPage]:
    """Seconds from asking for the page to a frame with all that is wanted, and the page."""
    viewer = ViewerPage(browser.new_context(viewport=SIZE).new_page())
    start = time.monotonic()
    viewer.page.goto(f"{address}?fixedDpr=1", wait_until="commit")
    viewer._wait(_HAS_DRAWN, list(wanted), 120)
    return time.monotonic() - start, viewer


def _until_panels_are_filled(viewer: ViewerPage) -> float:
    """Seconds until the main panel has its tabs."""
    start = time.monotonic()
    viewer.page.get_by_role("tab", name="Export").wait_for(timeout=60_000)
    return time.monotonic() - start


def _orbit(viewer: ViewerPage) -> float:
    """Frames drawn per second while the view turns."""
    viewer.page.evaluate(_ORBIT, 3.0)  # the page finds out how fast it is
    return float(viewer.page.evaluate(_ORBIT, ORBIT_S))


def _heap_mb(viewer: ViewerPage) -> float:
    """What scripts hold after tidying up: objects, and the buffers behind arrays."""
    tools = viewer.page.context.new_cdp_session(viewer.page)
    tools.send("HeapProfiler.collectGarbage")
    used = tools.send("Runtime.getHeapUsage")
    return float(used["usedSize"] + used.get("backingStorageSize", 0)) / 1e6


@contextmanager
def _mesh_alone(app: App, display: ScanDisplay) -> Any:
    """The address of a page with the display mesh and nothing else, seen from the same place."""
    server = make_server(0, Routes())
    layer = RoomLayer(server.scene)
    layer.show(display.glb)
    layer.set_look(two_sided=display.front == 0)
    set_start(server, app.data.mesh(), "z")
    try:
        yield f"http://localhost:{server.get_port()}"
    finally:
        server.stop()
