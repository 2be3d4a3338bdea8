"""Tool: going to a camera. The recording's show their frame, the phone's are looked through."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import RigidTransform

from gazeloc_app.actions.action import Action
from gazeloc_app.actions.views import ShowFrame
from gazeloc_app.keypoints import picking
from gazeloc_app.state import Layer
from gazeloc_app.tools.tool import Click, Tool

FRUSTUM_M = 0.12


class CameraTool(Tool):
    """A click on a camera goes to its frame; the phone's have no place on the slider and are looked through."""

    name = "goes to a camera's frame"
    hint = "Nothing is set by mistake. Shift-click sets a point all the same."
    aims = False

    def click(self, click: Click) -> Action | None:
        """The camera under the click, also one that was thinned out; of a layer that is hidden none is meant."""
        bench, state = self.bench, self.bench.state()
        trajectory = None
        if state.layers.is_visible(Layer.ESTIMATE):
            trajectory = bench.data.trajectory(state.recording, bench.data.poses_key(state.recording, state.annotation))
        frames = np.zeros(0, np.int64) if trajectory is None else trajectory.localised_keyframes
        photos = bench.data.scan().frames_with_images if state.layers.is_visible(Layer.PHONE) else ()
        poses = [photo.scan_from_camera for photo in photos]
        if trajectory is not None and len(frames):
            poses.insert(0, trajectory.poses(frames))
        if not poses:
            return None
        every = RigidTransform.concatenate(poses)
        forward = every.rotation.as_matrix()[:, :, 2]
        centers = np.asarray(every.translation)
        found = picking.pick_frustum(
            centers, forward, click.origin, click.direction, FRUSTUM_M, bench.tolerance_rad(), bench.cut.kept
        )
        if found is None:
            return None
        if found < len(frames):
            return ShowFrame(int(frames[found]))
        bench.looking.look_with_phone(found - len(frames))
        return None
