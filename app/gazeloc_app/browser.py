"""What belongs to one browser: its pick mode, its clicks, and the camera it looks through. A reload forgets it."""

from __future__ import annotations

import time
from collections.abc import Callable
from enum import StrEnum
from typing import Any

import numpy as np
import viser

from gazeloc_app import picking, widgets
from gazeloc_app.actions import Action, Notify, PickPoint, PickSighting, ShowFrame, Side
from gazeloc_app.data import ProjectData
from gazeloc_app.placement import shown_scan_from_sfm
from gazeloc_app.render_process import RenderProcess
from gazeloc_app.render_worker import Frame
from gazeloc_app.scene.frames import PLANE_M, FrameInSceneLayer, look_through
from gazeloc_app.scene_view import SceneView, when_picture
from gazeloc_app.sightings import frame_pose, triangulated
from gazeloc_app.state import AppState, Level
from gazeloc_core.arrays import Floats
from gazeloc_core.errors import GazelocError
from gazeloc_core.keypoints import Point, Sighting

DEBOUNCE_S = 0.15
SAME_SPOT_RAD = 0.002
FRUSTUM_M = 0.12


class PickMode(StrEnum):
    """What a click in the scene makes, for one browser. Dragging orbits in every mode and never makes anything."""

    OFF = "goes to a camera's frame"
    SCAN = "sets a point on the scan"
    SFM = "sets a point in the reconstruction"
    FRAME = "sets a point in the frame"


class Browser:
    """One connected page."""

    def __init__(
        self,
        client: viser.ClientHandle,
        data: ProjectData,
        view: SceneView,
        render: RenderProcess,
        state: Callable[[], AppState],
        dispatch: Callable[[Action], None],
    ):
        self._client, self._data, self._view, self._render = client, data, view, render
        self._state, self._dispatch = state, dispatch
        self._last_click = (0.0, np.zeros(3))
        self._picture = FrameInSceneLayer(client.scene)
        self._looking_at: tuple[str, int] | None = None
        gui = client.gui
        self._mode: Any = gui.add_dropdown(
            "A click", tuple(PickMode), hint="In this browser only. Dragging always orbits. The key P goes on."
        )
        self._move = gui.add_checkbox("Move point", False, hint="The click moves the selected pair's point.")
        self._leave = gui.add_button("Leave the frame", visible=False, color="gray")
        widgets.on_user(self._leave, lambda _: self.leave_frame(), event="on_click")
        toggle = gui.add_command("Next pick mode", hotkey="P", description="What a click does")
        widgets.on_user(toggle, lambda _: self._next_mode(), event="on_trigger")

        async def clicked(event: Any) -> None:
            self.click(np.array(event.ray_origin), np.array(event.ray_direction))

        handler: Any = clicked  # viser takes coroutines too, which its annotation does not say
        client.scene.on_click()(handler)

    @property
    def mode(self) -> PickMode:
        """What a click makes now; a value that the page made up counts as nothing."""
        value = str(self._mode.value)
        return PickMode(value) if value in tuple(PickMode) else PickMode.OFF

    def click(self, origin: Floats, direction: Floats) -> None:
        """Act on a click whose ray is given in the frame `scan`."""
        now = time.monotonic()
        before, aim = self._last_click
        self._last_click = (now, direction)
        if now - before < DEBOUNCE_S and np.linalg.norm(direction - aim) < SAME_SPOT_RAD:
            return  # the second half of a double click
        try:
            picks = {
                PickMode.OFF: self._pick_camera,
                PickMode.SCAN: self._pick_scan,
                PickMode.SFM: self._pick_cloud,
                PickMode.FRAME: self._pick_in_frame,
            }
            action = picks[self.mode](origin, direction)
        except GazelocError as error:
            action = Notify(Level.ERROR, str(error))
        if action is not None:
            self._dispatch(action)

    def look(self, frame: int) -> None:
        """Put this browser's camera where the frame's camera was, with the frame's picture before it."""
        state = self._state()
        pose, camera = frame_pose(self._data, state, frame), self._data.camera(state.recording)
        if pose is None or camera is None:
            text = f"Frame {frame} is not in the reconstruction, so there is nothing to look through; try a keyframe."
            self._dispatch(Notify(Level.WARNING, text))
            return
        target = (state.recording, frame)
        self._looking_at = target
        width, height = int(self._client.camera.image_width), int(self._client.camera.image_height)
        view = look_through(pose, camera, width / max(height, 1))
        with self._client.atomic():
            self._client.camera.fov = view.fov_rad
            self._client.camera.wxyz = view.wxyz
            self._client.camera.position = view.position
        widgets.set_property(self._leave, "visible", True)

        def paste(image: Any) -> None:
            if self._looking_at == target:
                self._picture.show(pose, camera, image)

        future = self._render.submit(
            Frame(recording=state.recording, index=frame), key=f"look {self._client.client_id}"
        )
        future.add_done_callback(when_picture(paste))

    def leave_frame(self) -> None:
        """Take the frame's picture away; the camera stays."""
        self._looking_at = None
        self._picture.show(None, None, None)
        widgets.set_property(self._leave, "visible", False)

    def render(self, state: AppState) -> None:
        """Follow the frame slider while looking through a camera."""
        if self._looking_at is not None and self._looking_at != (state.recording, state.frame):
            self.look(state.frame)

    def _next_mode(self) -> None:
        modes = tuple(PickMode)
        self._mode.value = modes[(modes.index(self.mode) + 1) % len(modes)]
        self._client.add_notification("Pick mode", f"A click {self.mode.value}.", auto_close_seconds=2.5)

    def _tolerance(self) -> float:
        height = max(int(self._client.camera.image_height), 1)
        return picking.tolerance_rad(float(self._client.camera.fov), height)

    def _pick_scan(self, origin: Floats, direction: Floats) -> Action:
        raycaster = self._data.raycaster()
        point = picking.pick_mesh(raycaster, origin, direction, front=self._view.front)
        if point is None:
            return Notify(Level.INFO, "There is no scan under the click.")
        return PickPoint(Side.SCAN, _point(point), move=bool(self._move.value))

    def _pick_cloud(self, origin: Floats, direction: Floats) -> Action:
        state = self._state()
        model, scan_from_sfm = self._data.model(state.recording), shown_scan_from_sfm(self._data, state)
        if model is None or scan_from_sfm is None:
            return Notify(Level.WARNING, "There is no reconstruction yet; run the stages first.")
        found = picking.pick_cloud(scan_from_sfm.apply(model.points), origin, direction, self._tolerance())
        if found is None:
            return Notify(Level.INFO, "There is no point of the reconstruction under the click.")
        return PickPoint(Side.SFM, _point(model.points[found]), move=bool(self._move.value))

    def _pick_in_frame(self, origin: Floats, direction: Floats) -> Action:
        state = self._state()
        if self._looking_at is None:
            return Notify(Level.INFO, "Look through a camera first (button in the panel “Frame”), then click in it.")
        recording, frame = self._looking_at
        pose, camera = frame_pose(self._data, state, frame), self._data.camera(recording)
        if pose is None or camera is None:
            return Notify(Level.WARNING, f"Frame {frame} has no pose.")
        pixel = picking.pixel_in_frame(camera, pose, origin, direction, PLANE_M)
        if pixel is None:
            return Notify(Level.INFO, "The click is beside the frame.")
        sighting = Sighting(frame, float(pixel[0]), float(pixel[1]))
        selected = state.annotation.keypoints.get(state.selected_key) if state.selected_key else None
        if selected is None or (selected.sfm is not None and not selected.sightings and not self._move.value):
            return PickSighting(sighting)
        sightings = selected.with_sighting(sighting)
        if len(sightings) < 2:
            return PickSighting(sighting, selected.key)
        found = triangulated(self._data, recording, sightings)
        if isinstance(found, str):
            self._dispatch(Notify(Level.WARNING, found))
            return PickSighting(sighting, selected.key)
        return PickSighting(sighting, selected.key, *found)

    def _pick_camera(self, origin: Floats, direction: Floats) -> Action | None:
        state = self._state()
        trajectory = self._data.trajectory(state.recording, self._data.poses_key(state.recording, state.annotation))
        if trajectory is None or not trajectory.is_localised.any():
            return None
        frames = np.flatnonzero(trajectory.is_localised)
        poses = trajectory.poses(frames)
        forward = poses.rotation.as_matrix()[:, :, 2]
        found = picking.pick_frustum(
            np.asarray(poses.translation), forward, origin, direction, FRUSTUM_M, self._tolerance()
        )
        return None if found is None else ShowFrame(int(frames[found]))


def _point(values: Floats) -> Point:
    x, y, z = (float(value) for value in values)
    return x, y, z
