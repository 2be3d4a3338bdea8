"""Tool: a keypoint's place in the frame that is looked through; clicks in two frames give a place in space."""

from __future__ import annotations

from gazeloc_app.actions.action import Action, Notify
from gazeloc_app.actions.picks import PickSighting
from gazeloc_app.frames.sightings import triangulated
from gazeloc_app.keypoints import picking
from gazeloc_app.scene.frames import PLANE_M
from gazeloc_app.state import Level
from gazeloc_app.tools.tool import Click, Tool
from gazeloc_core.keypoints import Sighting, add_sighting


class FramePointTool(Tool):
    """A click sets a point in the frame that this browser looks through, the recording's or the phone's."""

    name = "sets a point in the frame"
    hint = "Look through a camera first. Clicks in two frames make a place in space, in more frames a better one."

    def click(self, click: Click) -> Action:
        """The pixel under the click, and what all of the selected pair's clicks on that side triangulate to."""
        bench, state = self.bench, self.bench.state()
        target = bench.looking.target
        if target is None:
            return Notify(
                Level.INFO,
                "Look through a camera first (button in the panel “Frame”, or click a blue one of the phone), "
                "then click in it.",
            )
        pose, camera = bench.looking.pose_and_camera(state)
        if pose is None or camera is None:
            return Notify(Level.WARNING, f"Frame {target.frame} has no pose.")
        pixel = picking.pixel_in_frame(camera, pose, click.origin, click.direction, PLANE_M)
        if pixel is None:
            return Notify(Level.INFO, "The click is beside the frame.")
        side, sighting = target.side, Sighting(target.frame, float(pixel[0]), float(pixel[1]))
        selected = state.annotation.keypoints.get(state.selected_key) if state.selected_key else None
        is_free = selected is not None and (side.point_of(selected) is None or side.sightings_of(selected))
        if selected is None or not (is_free or bench.moves()):
            return PickSighting(sighting, side=side)
        sightings = add_sighting(side.sightings_of(selected), sighting)
        if len(sightings) < 2:
            return PickSighting(sighting, selected.key, side=side)
        found = triangulated(bench.data, state.recording, sightings, side)
        if isinstance(found, str):
            bench.dispatch(Notify(Level.WARNING, found))
            return PickSighting(sighting, selected.key, side=side)
        return PickSighting(sighting, selected.key, *found, side=side)
