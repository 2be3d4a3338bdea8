"""What a person does on the app's page: tabs, buttons, the pick mode, typing into fields, clicking a spot on a wall."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from e2e.page import ViewerPage

from gazeloc_core.arrays import Floats


class AppPage:
    """A page with the app; `app` is the app behind it, whose state tests look at."""

    def __init__(self, viewer: ViewerPage, app: Any):
        self.viewer, self.page, self.app = viewer, viewer.page, app

    @property
    def state(self) -> Any:
        """The app's state now."""
        return self.app.store.state

    @property
    def pairs(self) -> Any:
        """The keypoints now."""
        return self.state.annotation.keypoints.pairs

    def tab(self, name: str) -> AppPage:
        """Open a tab of the main panel."""
        self.page.get_by_role("tab", name=name, exact=True).click()
        return self

    def press(self, name: str) -> AppPage:
        """Press a button once it can be pressed."""
        self.page.get_by_role("button", name=name, exact=True).click(timeout=60_000)
        return self

    def choose(self, label: str, option: str) -> AppPage:
        """Choose an option of the dropdown with this label."""
        self.field(label).click()
        self.page.get_by_role("option", name=option, exact=True).click()
        return self

    def field(self, label: str) -> Any:
        """The input beside a label; viser's labels do not name it."""
        texts = self.page.locator("label").filter(has_text=re.compile(f"^{re.escape(label)}$"))
        return texts.locator("xpath=ancestor::div[.//input][1]").locator("input:not([type=hidden])").first

    def until(self, is_so: Any, seconds: float = 60.0) -> AppPage:
        """Wait until something is so, and then until it is drawn."""
        self.viewer.wait_until(is_so, seconds)
        self.viewer.settle()
        return self

    def click_for(self, point_in_scan: Floats, change: Any) -> Floats:
        """Click a place of the view and wait until `change()` differs; returns the pixel's centre."""
        before = change()
        pixel = self.viewer.click_at_point(point_in_scan)
        self.viewer.wait_until(lambda: change() != before)
        return pixel

    def pixels_near(self, point_in_scan: Floats, color: Any, reach_px: int = 14, tolerance: int = 35) -> int:
        """How many pixels around a place have about this colour."""
        around = self.viewer.pixels_around(point_in_scan, reach_px)
        return int((np.abs(around - color).max(axis=2) < tolerance).sum())
