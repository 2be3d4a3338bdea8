"""Where the wearer looked at one frame: in the undistorted picture, and as a ray in the scan."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gazeloc_app.data import ProjectData
from gazeloc_core.arrays import Floats
from gazeloc_core.camera import Camera
from gazeloc_core.trajectory import Trajectory

NEAREST_NS = 50_000_000
"""A gaze sample further from the frame's time than this says nothing about the frame."""


def gaze_ray_in_camera(data: ProjectData, recording: str, frame: int) -> Floats | None:
    """The unit ray (3,) in the scene camera of the gaze sample nearest in time; None where nothing is tracked then."""
    opened = data.recording(recording)
    if opened.gaze is None or len(opened.gaze) == 0 or frame >= len(opened):
        return None
    at, times = int(opened.timestamp_ns[frame]), opened.gaze.timestamp_ns
    after = min(int(np.searchsorted(times, at)), len(times) - 1)
    nearest = min((max(after - 1, 0), after), key=lambda sample: abs(int(times[sample]) - at))
    worn = opened.gaze.worn is None or bool(opened.gaze.worn[nearest])
    if abs(int(times[nearest]) - at) > NEAREST_NS or not worn:
        return None
    ray = opened.camera.unproject(opened.gaze.pixels[nearest : nearest + 1])[0]
    return ray if np.isfinite(ray).all() else None


def gaze_as_recorded(data: ProjectData, recording: str, frame: int) -> tuple[float, float] | None:
    """The gaze in the frame as recorded, as `gaze_in_frame`."""
    return gaze_in_frame(data, recording, frame, data.recording(recording).camera)


def gaze_in_frame(data: ProjectData, recording: str, frame: int, camera: Camera | None) -> tuple[float, float] | None:
    """The gaze in the undistorted picture as shares of its width and height; None where it is not in the picture."""
    ray = gaze_ray_in_camera(data, recording, frame)
    if ray is None or camera is None:
        return None
    x, y = camera.project(ray[None])[0] / (camera.width, camera.height)
    return (float(x), float(y)) if 0 <= x <= 1 and 0 <= y <= 1 else None


@dataclass(frozen=True, eq=False)
class GazeRay:
    """A ray in the scan: `origin` (3,) the camera's centre, `direction` (3,), and its `hit` (3,) or None for a miss."""

    origin: Floats
    direction: Floats
    hit: Floats | None


def gaze_in_scan(data: ProjectData, recording: str, frame: int, trajectory: Trajectory | None) -> GazeRay | None:
    """Where the gaze at a frame meets the scan; None without pose or gaze."""
    pose = None if trajectory is None or frame >= len(trajectory) else trajectory.pose(frame)
    ray = None if pose is None else gaze_ray_in_camera(data, recording, frame)
    if ray is None or pose is None:
        return None
    origin, direction = np.array(pose.translation), pose.rotation.as_matrix() @ ray
    raycaster = data.raycaster()
    hits = raycaster.cast(origin[None], direction[None])
    return GazeRay(origin, direction, raycaster.points(hits)[0] if hits.is_hit[0] else None)
