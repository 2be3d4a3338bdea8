"""Tool: a measuring tape, for this browser alone."""

from __future__ import annotations

from gazeloc_app.actions.action import Action, Notify
from gazeloc_app.scene.sizes import size_factor
from gazeloc_app.scene.tape import TapeLayer, length_text
from gazeloc_app.state import Level
from gazeloc_app.tools.tool import Bench, Click, Tool
from gazeloc_core.keypoints import Point
from gazeloc_core.surfaces.viewpoint import room_corners, up_vector


class TapeTool(Tool):
    """Two clicks on the scan give the distance between them; the third starts anew."""

    name = "measures a distance"
    hint = "Two clicks on the scan, centimetres between them; nobody else sees it."

    def __init__(self, bench: Bench):
        super().__init__(bench)
        self._layer = TapeLayer(bench.client.scene, size_factor(*room_corners(bench.data.scan().mesh)))
        self._ends: tuple[Point, ...] = ()

    def click(self, click: Click) -> Action | None:
        """Set an end of the tape."""
        point = self.bench.point_on_scan(click)
        if point is None:
            return Notify(Level.INFO, "There is no scan under the click.")
        self._ends = (point,) if len(self._ends) == 2 else (*self._ends, point)
        up = up_vector(self.bench.data.scan().up_axis)
        self._layer.show(self._ends, length_text(*self._ends, up) if len(self._ends) == 2 else "")
        return None

    def put_away(self) -> None:
        """Roll the tape up."""
        self._ends = ()
        self._layer.show(())
