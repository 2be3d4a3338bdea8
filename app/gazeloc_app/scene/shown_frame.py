"""The frame that is shown, in the scene: its camera with its picture, and where the wearer looked."""

from __future__ import annotations

import threading
from typing import NamedTuple

import viser
from scipy.spatial.transform import RigidTransform

from gazeloc_app.data import ProjectData
from gazeloc_app.drawing.jpeg import when_picture
from gazeloc_app.drawing.render_jobs import Frame
from gazeloc_app.drawing.render_process import RenderProcess
from gazeloc_app.frames.gaze_at import gaze_in_scan
from gazeloc_app.frames.settling import Settling
from gazeloc_app.scene.frames import SelectedFrameLayer
from gazeloc_app.scene.gaze import GazeLayer
from gazeloc_core.arrays import Bytes
from gazeloc_core.camera import Camera
from gazeloc_core.trajectory import Trajectory

THUMBNAIL_PX = 320


class _Wanted(NamedTuple):
    recording: str
    frame: int
    trajectory: Trajectory | None


class ShownFrame:
    """Follows the frame once frames have come to rest, and at once while they play: a scene drawn anew holds pages up.

    The only part of the scene that several threads draw: the loop of the store, what waited for rest, and pictures that
    have come.
    """

    def __init__(self, server: viser.ViserServer, data: ProjectData, render: RenderProcess):
        self._server, self._data, self._render = server, data, render
        self._camera = SelectedFrameLayer(server.scene)
        self._gaze = GazeLayer(server.scene)
        self._settling = Settling()
        self._drawing = threading.RLock()
        self._wanted: _Wanted | None = None

    def show(self, recording: str, frame: int, trajectory: Trajectory | None, *, is_playing: bool) -> None:
        """Show a frame where these poses put it; one without a pose, or without poses, is not drawn."""
        wanted = _Wanted(recording, frame, trajectory)
        with self._drawing:
            if wanted == self._wanted:
                return
            self._wanted = wanted
        later = self._settling.now if is_playing else self._settling.soon
        later(lambda: self._draw(wanted))

    def resize(self, factor: float) -> None:
        """Multiply the size of the gaze's point by this from now on (`sizes.size_factor`)."""
        with self._drawing:
            self._gaze.size = factor

    def show_camera(self, is_on: bool) -> None:
        """Show or hide the camera."""
        with self._drawing:
            self._camera.set_visible(is_on)

    def show_gaze(self, is_on: bool) -> None:
        """Show or hide the gaze."""
        with self._drawing:
            self._gaze.set_visible(is_on)

    def stop(self) -> None:
        """Draw nothing any more."""
        self._settling.drop()

    def _draw(self, wanted: _Wanted) -> None:
        recording, frame, trajectory = wanted
        camera = self._data.camera(recording)
        pose = trajectory.pose(frame) if trajectory is not None and frame < len(trajectory) else None
        ray = gaze_in_scan(self._data, recording, frame, trajectory)
        with self._drawing:
            if wanted != self._wanted:
                return  # another frame came while this one waited
            with self._server.atomic():
                self._camera.show(pose, camera)
                self._gaze.show(*((None,) if ray is None else (ray.origin, ray.direction, ray.hit)))
        if pose is not None:
            job = Frame(recording=recording, index=frame, width=THUMBNAIL_PX)
            picture = self._render.submit(job, key="thumbnail")
            picture.add_done_callback(when_picture(lambda image: self._paste(wanted, pose, camera, image)))

    def _paste(self, wanted: _Wanted, pose: RigidTransform, camera: Camera | None, image: Bytes) -> None:
        with self._drawing:
            if wanted == self._wanted:  # another frame may have been chosen while this one was decoded
                self._camera.show(pose, camera, image)
