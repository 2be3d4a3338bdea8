"""Tool: a keypoint's place on the scan's surface."""

from __future__ import annotations

import numpy as np

from gazeloc_app.actions.action import Action, Notify
from gazeloc_app.actions.picks import PickPoint, Side
from gazeloc_app.state import Level
from gazeloc_app.tools.tool import Click, Tool, as_point
from gazeloc_core.transforms import Similarity


class ScanPointTool(Tool):
    """A click sets a point where it meets the scan."""

    name = "sets a point on the scan"
    hint = "Completes the selected pair, else starts a new one."

    def click(self, click: Click) -> Action:
        """The point under the click."""
        point = self.bench.point_on_scan(click)
        there = None if point is None else np.array(point)
        tag = self.bench.snapped(click, self.bench.data.scan_tags(), Similarity.identity(), there)
        if tag is not None:
            return PickPoint(Side.SCAN, as_point(tag.point), move=self.bench.moves(), name=tag.name)
        if point is None:
            return Notify(Level.INFO, "There is no scan under the click.")
        return PickPoint(Side.SCAN, point, move=self.bench.moves())
