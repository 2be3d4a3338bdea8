"""What belongs to one browser: its pick mode, its clicks, and the camera it looks through. A reload forgets it."""

from __future__ import annotations

import time
from collections.abc import Callable
from enum import StrEnum
from typing import Any, NamedTuple

import numpy as np
import viser
from scipy.spatial.transform import RigidTransform

from gazeloc_app import picking, widgets
from gazeloc_app.actions.action import Action, Notify
from gazeloc_app.actions.picks import PickPoint, PickSighting, Side
from gazeloc_app.actions.views import ShowFrame
from gazeloc_app.data import ProjectData
from gazeloc_app.placement import shown_scan_from_sfm
from gazeloc_app.render_process import RenderProcess
from gazeloc_app.render_worker import Frame, Photo, camera_text
from gazeloc_app.scene.frames import PLANE_M, FrameInSceneLayer, look_through
from gazeloc_app.scene_view import SceneView, when_picture
from gazeloc_app.sightings import frame_pose, triangulated
from gazeloc_app.state import AppState, Layer, Level
from gazeloc_core.arrays import Floats
from gazeloc_core.camera import Camera
from gazeloc_core.errors import GazelocError
from gazeloc_core.keypoints import Point, Sighting, add_sighting

DEBOUNCE_S = 0.15
SAME_SPOT_RAD = 0.002
FRUSTUM_M = 0.12


class PickMode(StrEnum):
    """What a click in the scene makes, for one browser. Dragging orbits in every mode and never makes anything."""

    OFF = "goes to a camera's frame"
    SCAN = "sets a point on the scan"
    SFM = "sets a point in the reconstruction"
    FRAME = "sets a point in the frame"


class _Looked(NamedTuple):
    """The frame that is looked through: of a recording, or (`recording` None) of the scan's `frames_with_images`."""

    recording: str | None
    frame: int

    @property
    def side(self) -> Side:
        """Which side of a keypoint a click in it sets."""
        return Side.SCAN if self.recording is None else Side.SFM


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
        self._looking_at: _Looked | None = None
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
        job = Frame(recording=state.recording, index=frame)
        self._look_from(_Looked(state.recording, frame), pose, camera, job)

    def look_with_phone(self, frame: int) -> None:
        """Put this browser's camera where the phone's was, with the picture of `scan.frames_with_images[frame]`."""
        photo = self._data.scan().frames_with_images[frame]
        job = Photo(path=str(photo.image_path), camera=camera_text(photo.camera))
        self._look_from(_Looked(None, frame), photo.scan_from_camera, photo.camera, job)

    def _look_from(self, target: _Looked, pose: RigidTransform, camera: Camera, job: Frame | Photo) -> None:
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

        future = self._render.submit(job, key=f"look {self._client.client_id}")
        future.add_done_callback(when_picture(paste))

    def leave_frame(self) -> None:
        """Take the frame's picture away; the camera stays."""
        self._looking_at = None
        self._picture.show(None, None, None)
        widgets.set_property(self._leave, "visible", False)

    def render(self, state: AppState) -> None:
        """Follow the frame slider while looking through a camera of the recording."""
        at = self._looking_at
        if at is not None and at.side is Side.SFM and at != _Looked(state.recording, state.frame):
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
            return Notify(
                Level.INFO,
                "Look through a camera first (button in the panel “Frame”, or click a blue one of the phone while a "
                f"click “{PickMode.OFF.value}”), then click in it.",
            )
        frame, side = self._looking_at.frame, self._looking_at.side
        pose, camera = self._pose_and_camera(state, self._looking_at)
        if pose is None or camera is None:
            return Notify(Level.WARNING, f"Frame {frame} has no pose.")
        pixel = picking.pixel_in_frame(camera, pose, origin, direction, PLANE_M)
        if pixel is None:
            return Notify(Level.INFO, "The click is beside the frame.")
        sighting = Sighting(frame, float(pixel[0]), float(pixel[1]))
        selected = state.annotation.keypoints.get(state.selected_key) if state.selected_key else None
        is_free = selected is not None and (side.point_of(selected) is None or side.sightings_of(selected))
        if selected is None or not (is_free or self._move.value):
            return PickSighting(sighting, side=side)
        sightings = add_sighting(side.sightings_of(selected), sighting)
        if len(sightings) < 2:
            return PickSighting(sighting, selected.key, side=side)
        found = triangulated(self._data, state.recording, sightings, side)
        if isinstance(found, str):
            self._dispatch(Notify(Level.WARNING, found))
            return PickSighting(sighting, selected.key, side=side)
        return PickSighting(sighting, selected.key, *found, side=side)

    def _pose_and_camera(self, state: AppState, at: _Looked) -> tuple[RigidTransform | None, Camera | None]:
        if at.recording is None:
            photo = self._data.scan().frames_with_images[at.frame]
            return photo.scan_from_camera, photo.camera
        return frame_pose(self._data, state, at.frame), self._data.camera(at.recording)

    def _pick_camera(self, origin: Floats, direction: Floats) -> Action | None:
        """Go to the frame of the clicked camera; the phone's have no place on the slider and are looked through."""
        state = self._state()
        trajectory = self._data.trajectory(state.recording, self._data.poses_key(state.recording, state.annotation))
        frames = np.zeros(0, np.int64) if trajectory is None else np.flatnonzero(trajectory.is_localised)
        photos = self._data.scan().frames_with_images if state.layers.is_visible(Layer.PHONE) else ()
        poses = [photo.scan_from_camera for photo in photos]
        if trajectory is not None and len(frames):
            poses.insert(0, trajectory.poses(frames))
        if not poses:
            return None
        every = RigidTransform.concatenate(poses)
        forward = every.rotation.as_matrix()[:, :, 2]
        found = picking.pick_frustum(
            np.asarray(every.translation), forward, origin, direction, FRUSTUM_M, self._tolerance()
        )
        if found is None:
            return None
        if found < len(frames):
            return ShowFrame(int(frames[found]))
        self.look_with_phone(found - len(frames))
        return None


def _point(values: Floats) -> Point:
    x, y, z = (float(value) for value in values)
    return x, y, z
