"""Tool: a keypoint's place in the frame that is looked through; clicks in two frames give a place in space."""

from __future__ import annotations

from gazeloc_app.actions.action import Action, Notify
from gazeloc_app.frames.frame_clicks import clicked_in_frame
from gazeloc_app.keypoints import picking
from gazeloc_app.scene.frames import PLANE_M
from gazeloc_app.state import Level
from gazeloc_app.tools.tool import Click, Tool


class FramePointTool(Tool):
    """A click sets a point in the frame that this browser looks through, the recording's or the phone's."""

    name = "sets a point in the frame"
    hint = "Look through a camera first. Clicks in two frames make a place in space, in more frames a better one."

    def click(self, click: Click) -> Action:
        """The pixel under the click, a tag's corner near it, and what the pair's clicks on that side triangulate to."""
        bench, state = self.bench, self.bench.state()
        target = bench.looking.pictured
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
        reach_px = bench.reach_px(camera) if bench.snaps() else 0.0
        *notices, pick = clicked_in_frame(
            bench.data, state, target.side, target.frame, pixel, moves=bench.moves(), reach_px=reach_px
        )
        for notice in notices:
            bench.dispatch(notice)
        return pick
