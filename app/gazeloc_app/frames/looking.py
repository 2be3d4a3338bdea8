"""Looking through a camera: one browser's view put where a camera was, with the camera's picture before it."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any, NamedTuple

import viser
from scipy.spatial.transform import RigidTransform

from gazeloc_app.actions.action import Action, Notify
from gazeloc_app.actions.picks import Side
from gazeloc_app.data import ProjectData
from gazeloc_app.drawing.jpeg import when_picture
from gazeloc_app.drawing.render_jobs import Frame, Photo, camera_text
from gazeloc_app.drawing.render_process import RenderProcess
from gazeloc_app.frames.sightings import frame_pose
from gazeloc_app.scene.frames import FrameInSceneLayer, look_through
from gazeloc_app.state import AppState, Level
from gazeloc_core.camera import Camera


class Target(NamedTuple):
    """The frame that is looked through: of a recording, or (`recording` None) of the scan's `frames_with_images`."""

    recording: str | None
    frame: int

    @property
    def side(self) -> Side:
        """Which side of a keypoint a click in it sets."""
        return Side.SCAN if self.recording is None else Side.SFM


class Looking:
    """What one browser looks through."""

    def __init__(
        self,
        client: viser.ClientHandle,
        data: ProjectData,
        render: RenderProcess,
        state: Callable[[], AppState],
        dispatch: Callable[[Action], None],
    ):
        self._client, self._data, self._render = client, data, render
        self._state, self._dispatch = state, dispatch
        self._picture = FrameInSceneLayer(client.scene)
        self._showing = threading.Lock()
        """Held while the picture is put up or taken away: it comes from another thread than the wish to leave."""
        self.target: Target | None = None
        """What is looked through now; None for the room from outside."""
        self.follows = True
        """Whether the view goes on with the frame."""
        self.shows_picture = True
        """Whether the frame's picture stands before the view; without it the scan is seen from where the camera was."""

    @property
    def pictured(self) -> Target | None:
        """The frame whose picture is before the view, so that clicks are in it; None where clicks are on the scan."""
        return self.target if self.shows_picture else None

    def look(self, frame: int) -> None:
        """Put this browser's camera where the frame's camera was, with the frame's picture before it."""
        state = self._state()
        pose, camera = self._any_pose(state, frame), self._data.camera(state.recording)
        if pose is None or camera is None:
            text = f"Frame {frame} has no pose, so there is nothing to look through; try another one."
            self._dispatch(Notify(Level.WARNING, text))
            return
        job = Frame(recording=state.recording, index=frame)
        self._look_from(Target(state.recording, frame), pose, camera, job)

    def look_with_phone(self, frame: int) -> None:
        """Put this browser's camera where the phone's was, with the picture of `scan.frames_with_images[frame]`."""
        photo = self._data.scan().frames_with_images[frame]
        job = Photo(path=str(photo.image_path), camera=camera_text(photo.camera))
        self._look_from(Target(None, frame), photo.scan_from_camera, photo.camera, job)

    def look_again(self, recording: str | None, frame: int) -> None:
        """Look through a frame as before a reload; what is no longer there, or not the slider's frame, is left out."""
        state = self._state()
        if recording is None and 0 <= frame < len(self._data.scan().frames_with_images):
            self.look_with_phone(frame)
        elif (recording, frame) == (state.recording, state.frame):
            self.look(frame)

    def leave(self) -> None:
        """Take the frame's picture away; the camera stays."""
        with self._showing:
            self.target = None
            self._picture.show(None, None, None)

    def show_picture(self, is_on: bool) -> None:
        """Put the picture before the view, or take it away; the view stays at the camera."""
        with self._showing:
            self.shows_picture = is_on
            if not is_on:
                self._picture.show(None, None, None)
        at = self.target if is_on else None
        if at is not None and at.recording is None:
            self.look_with_phone(at.frame)
        elif at is not None:
            self.look(at.frame)

    def follow(self, state: AppState) -> None:
        """Go on to the frame of the slider while looking through a camera of the recording, where that is wanted."""
        at = self.target if self.follows else None
        is_elsewhere = at is not None and at.side is Side.SFM and at != Target(state.recording, state.frame)
        if is_elsewhere and self._any_pose(state, state.frame) is not None:  # frames without a pose are passed over
            self.look(state.frame)

    def _any_pose(self, state: AppState, frame: int) -> RigidTransform | None:
        """A frame's camera by the poses that are shown, or else where the reconstruction has it (`scan_from_camera`).

        Frames of the reconstruction are looked at where it has them, so that clicks in them fit to it.
        """
        pose = frame_pose(self._data, state, frame)
        if pose is not None:
            return pose
        trajectory = self._data.trajectory(state.recording, self._data.poses_key(state.recording, state.annotation))
        return trajectory.pose(frame) if trajectory is not None and frame < len(trajectory) else None

    def pose_and_camera(self, state: AppState) -> tuple[RigidTransform | None, Camera | None]:
        """Where the camera whose picture is looked through stands (`scan_from_camera`), and it; None without."""
        at = self.pictured
        if at is None:
            return None, None
        if at.recording is None:
            photo = self._data.scan().frames_with_images[at.frame]
            return photo.scan_from_camera, photo.camera
        return frame_pose(self._data, state, at.frame), self._data.camera(at.recording)

    def _look_from(self, target: Target, pose: RigidTransform, camera: Camera, job: Frame | Photo) -> None:
        self.target = target
        width, height = int(self._client.camera.image_width), int(self._client.camera.image_height)
        view = look_through(pose, camera, width / max(height, 1))
        with self._client.atomic():
            self._client.camera.fov = view.fov_rad
            self._client.camera.wxyz = view.wxyz
            self._client.camera.position = view.position

        def paste(image: Any) -> None:
            with self._showing:
                if self.pictured == target:
                    self._picture.show(pose, camera, image)

        future = self._render.submit(job, key=f"look {self._client.client_id}")
        future.add_done_callback(when_picture(paste))
