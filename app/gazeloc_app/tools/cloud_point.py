"""Tool: a keypoint's place in the reconstruction, one of its points."""

from __future__ import annotations

from gazeloc_app.actions.action import Action, Notify
from gazeloc_app.actions.picks import PickPoint, Side
from gazeloc_app.keypoints import picking
from gazeloc_app.placement import shown_scan_from_sfm
from gazeloc_app.state import Level
from gazeloc_app.tools.tool import Click, Tool, as_point


class CloudPointTool(Tool):
    """A click takes the front-most point of the reconstruction under it."""

    name = "sets a point in the reconstruction"
    hint = "Completes the selected pair, else starts a new one. Clicks in two frames are more exact."

    def click(self, click: Click) -> Action:
        """The point under the click."""
        state = self.bench.state()
        model, scan_from_sfm = self.bench.data.model(state.recording), shown_scan_from_sfm(self.bench.data, state)
        if model is None or scan_from_sfm is None:
            return Notify(Level.WARNING, "There is no reconstruction yet; run the stages first.")
        tag = self.bench.snapped(click, self.bench.data.sfm_tags(state.recording), scan_from_sfm, None)
        if tag is not None:
            return PickPoint(Side.SFM, as_point(tag.point), move=self.bench.moves(), name=tag.name)
        points_in_scan = scan_from_sfm.apply(model.points)
        tolerance, kept = self.bench.tolerance_rad(), self.bench.cut.kept
        found = picking.pick_cloud(points_in_scan, click.origin, click.direction, tolerance, kept)
        if found is None:
            return Notify(Level.INFO, "There is no point of the reconstruction under the click.")
        return PickPoint(Side.SFM, as_point(model.points[found]), move=self.bench.moves())
