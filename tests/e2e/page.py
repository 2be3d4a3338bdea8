"""The app's page in headless Chromium: waits for what is really drawn, and clicks on points of the world.

It reads viser's own test hooks in the page (`__viserMutable`, `__viserTestpoints`, `__viserPointer`); that they exist
is tested in test_scene_page.py.
"""

from __future__ import annotations

import base64
import os
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from playwright.sync_api import Browser, ConsoleMessage, Page, Playwright

ARTIFACTS = Path(__file__).resolve().parents[2] / "test-artifacts"
DRAW_TIMEOUT_S = 60.0
_FLAGS = [
    "--headless=new",
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-default-apps",
    "--disable-sync",
    "--no-first-run",
    "--mute-audio",
]
_FAST_FLAGS = ["--use-angle=gl-egl"]
"""Mesa instead of SwiftShader draws twice as fast; set GAZELOC_BROWSER_GL=mesa where it is installed."""
_DRAWN = """
() => {
  const drawn = window.__viserTestpoints?.rendererInfo;
  if (!window.__viserMutable?.requestRender || !drawn) return null;
  window.__viserMutable.requestRender();
  return drawn.render.frame;
}
"""
"""Asks for a frame; how many were drawn so far, null while the page is being loaded."""
_WORLD_TO_CLIP = """
() => {
  const m = window.__viserMutable;
  m.camera.updateMatrixWorld();
  const root = m.nodeRefFromName[''];
  root.updateWorldMatrix(true, false);
  const canvas = m.canvas.getBoundingClientRect();
  return {
    world: root.matrixWorld.elements, view: m.camera.matrixWorldInverse.elements,
    projection: m.camera.projectionMatrix.elements,
    left: canvas.left, top: canvas.top, width: canvas.width, height: canvas.height,
  };
}
"""


def chromium_path() -> str | None:
    """The browser's program, None where there is none."""
    names = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
    return next((path for name in names if (path := shutil.which(name))), None)


def launch(playwright: Playwright, path: str) -> Browser:
    """A browser that draws WebGL in software: the same everywhere, and without a display."""
    flags = [flag for flag in _FLAGS if not flag.startswith("--use-angle")] + _FAST_FLAGS
    chosen = flags if os.environ.get("GAZELOC_BROWSER_GL") == "mesa" else _FLAGS
    return playwright.chromium.launch(executable_path=path, headless=False, args=chosen)


class ViewerPage:
    """One open page of the app; `errors` are what its console and scripts complained about."""

    def __init__(self, page: Page):
        self.page = page
        self.errors: list[str] = []
        page.on("console", self._on_console)
        page.on("pageerror", lambda error: self.errors.append(str(error)))

    def open(self, address: str) -> ViewerPage:
        """Load the app; `fixedDpr` keeps viser from lowering its resolution when drawing is slow."""
        joiner = "&" if "?" in address else "?"
        self.page.goto(f"{address}{joiner}fixedDpr=1")
        self.page.wait_for_selector("canvas")
        return self

    def wait_until_drawn(self, triangles: int = 1, timeout_s: float = DRAW_TIMEOUT_S) -> ViewerPage:
        """Wait until one frame had at least so many triangles, the camera rests and clicks are taken note of."""
        self._wait(
            "n => { const m = window.__viserMutable, t = window.__viserTestpoints;"
            " return m && m.cameraControl && t && t.rendererInfo && t.rendererInfo.render.triangles >= n; }",
            triangles,
            timeout_s,
        )
        self._dismiss("Software WebGL rendering detected")
        end = time.monotonic() + timeout_s
        view = None
        while view != (view := self._view_if_any()):  # on a slow machine two frames may take a second
            assert time.monotonic() < end, "the camera does not come to rest"
            self.settle()
            self.page.wait_for_timeout(100)
        return self

    def wait_for_clicks(self, timeout_s: float = DRAW_TIMEOUT_S) -> ViewerPage:
        """Wait until the page knows that somebody listens to clicks on the scene."""
        self._wait("() => window.__viserPointer.hasSceneClickFilter()", None, timeout_s)
        return self

    def wait_for_node(self, name: str, present: bool = True, timeout_s: float = DRAW_TIMEOUT_S) -> ViewerPage:
        """Wait until a node of the scene is there, or gone."""
        self._wait("([n, p]) => !!window.__viserMutable.nodeRefFromName[n] === p", [name, present], timeout_s)
        return self.settle()

    def wait_until(self, is_so: Callable[[], bool], timeout_s: float = DRAW_TIMEOUT_S) -> None:
        """Wait until something that is looked up from here is so; the page goes on meanwhile."""
        end = time.monotonic() + timeout_s
        while not is_so():
            assert time.monotonic() < end, "it did not become so in time"
            self.page.wait_for_timeout(100)

    def settle(self) -> ViewerPage:
        """Wait until two more frames have been drawn."""
        before = self.page.evaluate(f"() => ({_DRAWN})()") or 0
        # a page that was loaded anew meanwhile counts from the start
        self._wait(
            f"f => {{ const n = ({_DRAWN})(); return n !== null && (n < f || n >= f + 2); }}", before, DRAW_TIMEOUT_S
        )
        return self

    def project(self, points_in_scan: Any) -> np.ndarray:
        """Places (N, 2) of world points (N, 3) in CSS pixels of the page, first pixel centre at 0.5; NaN behind it.

        From the page's own matrices, so independent of what Python believes about the camera.
        """
        m = self._view()
        world, view, projection = (np.reshape(m[name], (4, 4)).T for name in ("world", "view", "projection"))
        points = np.atleast_2d(np.asarray(points_in_scan, dtype=np.float64))
        clip = np.column_stack([points, np.ones(len(points))]) @ (projection @ view @ world).T
        clip[clip[:, 3] <= 0] = np.nan
        x, y = (clip[:, :2] / clip[:, 3:]).T
        return np.column_stack([m["left"] + (x + 1) / 2 * m["width"], m["top"] + (1 - y) / 2 * m["height"]])

    def click_at_point(self, point_in_scan: Any, modifiers: tuple[str, ...] = ()) -> np.ndarray:
        """Click the pixel in which a world point (3,) is; returns that pixel's centre (2,), which the ray goes through.

        A browser's pointer has whole positions, to which viser adds half a pixel.
        """
        pixel = np.floor(self.project(point_in_scan)[0])
        for key in modifiers:
            self.page.keyboard.down(key)
        self.page.mouse.click(*pixel)
        for key in modifiers:
            self.page.keyboard.up(key)
        return np.asarray(pixel + 0.5)

    def canvas_pixels(self) -> np.ndarray:
        """What the 3D view shows, (H, W, 3), without panels; one pixel per CSS pixel."""
        self.settle()
        url = self.page.evaluate("() => window.__viserMutable.canvas.toDataURL('image/png')")
        data = np.frombuffer(base64.b64decode(url.partition(",")[2]), np.uint8)
        return np.asarray(cv2.cvtColor(cv2.imdecode(data, cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB))

    def label_at(self, point_in_scan: Any, reach_px: int = 24) -> bool:
        """Whether dark letters are around a world point: labels are part of the 3D view, not of the page's text."""
        return bool((self.pixels_around(point_in_scan, reach_px).max(axis=2) < 70).any())

    def color_at(self, point_in_scan: Any) -> np.ndarray:
        """The colour (3,) of the canvas where a world point is."""
        return self.pixels_around(point_in_scan, 0)[0, 0]

    def has_color_near(self, point_in_scan: Any, color: Any, reach_px: int = 12, tolerance: int = 60) -> bool:
        """Whether a colour is around a world point, which a translucent label may cover."""
        around = self.pixels_around(point_in_scan, reach_px)
        return bool((np.abs(around - color).max(axis=2) < tolerance).any())

    def pixels_around(self, point_in_scan: Any, reach_px: int) -> np.ndarray:
        """The canvas (2 reach + 1, 2 reach + 1, 3) around a world point, as drawn by the view it is projected with."""
        for _ in range(20):
            before = self._view()
            x, y = (self.project(point_in_scan)[0] - self._corner()).astype(int)
            pixels = self.canvas_pixels().astype(int)
            if self._view() == before:
                return pixels[max(0, y - reach_px) : y + reach_px + 1, max(0, x - reach_px) : x + reach_px + 1]
        raise AssertionError("the view does not come to rest")

    def save(self, name: str) -> Path:
        """Keep a screenshot of the whole page under test-artifacts/."""
        ARTIFACTS.mkdir(exist_ok=True)
        path = ARTIFACTS / f"{name}.png"
        self.page.screenshot(path=str(path))
        return path

    def _corner(self) -> tuple[float, float]:
        m = self._view()
        return m["left"], m["top"]

    def _view(self) -> dict[str, Any]:
        """The page's own matrices, and where the 3D view lies in the page."""
        view: dict[str, Any] = self.page.evaluate(_WORLD_TO_CLIP)
        return view

    def _view_if_any(self) -> object:
        """The view; something else each time while the page is being loaded anew."""
        is_there = self.page.evaluate("() => Boolean(window.__viserMutable?.camera && window.__viserMutable.canvas)")
        return self._view() if is_there else object()

    def _dismiss(self, title: str) -> None:
        """Close viser's own notice with this title, which lies over the view."""
        notice = self.page.locator(".mantine-Notification-root").filter(has_text=title)
        if notice.count():
            notice.first.get_by_role("button").click()
            notice.first.wait_for(state="detached")

    def _wait(self, script: str, argument: Any, timeout_s: float, polling_ms: float = 50) -> None:
        self.page.wait_for_function(script, arg=argument, timeout=timeout_s * 1000, polling=polling_ms)

    def _on_console(self, message: ConsoleMessage) -> None:
        if message.type == "error":
            self.errors.append(message.text)
