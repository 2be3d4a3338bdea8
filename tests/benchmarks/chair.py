"""The real chair scan as scan and recording: every other picture plays the glasses, ARKit's poses are the truth.

The person who clicks is simulated: they see a place on the mesh, and the same place in frames, with 1.5 px of error.
Where it is in a frame is known from ARKit's pose of that frame, which nothing else here uses.
"""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np

from gazeloc_core.camera import Camera
from gazeloc_core.export.tum import write_tum
from gazeloc_core.readers import open_scan
from gazeloc_core.scan import RoomScan, ScanFrame
from gazeloc_core.trajectory import PoseStatus, Trajectory
from gazeloc_core.transforms import wxyz_of

FRAME_NS = 1_000_000_000


def held_out(scan: RoomScan) -> list[ScanFrame]:
    """Every other frame that has a picture."""
    return list(scan.frames_with_images[::2])


def common_camera(frames: list[ScanFrame]) -> Camera:
    """The camera of the middle frame: glasses have one, the phone's changes by some pixels from frame to frame."""
    return frames[len(frames) // 2].camera


def write_recording(source: Path, folder: Path) -> Path:
    """The held-out pictures as an image folder, each resampled from its own camera to the common one."""
    frames = held_out(open_scan(source, colored=False))
    camera = common_camera(frames)
    folder.mkdir(parents=True)
    half = np.array([[1, 0, -0.5], [0, 1, -0.5], [0, 0, 1]])  # OpenCV counts from the first pixel's centre
    for frame in frames:
        assert frame.image_path is not None
        common_from_own = half @ camera.matrix @ np.linalg.inv(frame.camera.matrix) @ np.linalg.inv(half)
        picture = cv2.warpAffine(
            cv2.imread(str(frame.image_path)), common_from_own[:2], (camera.width, camera.height), flags=cv2.INTER_CUBIC
        )
        cv2.imwrite(str(folder / frame.image_path.name), picture, [cv2.IMWRITE_JPEG_QUALITY, 95])
    (folder / "camera.json").write_text(json.dumps(camera.to_json()))
    return folder


def write_truth(source: Path, path: Path) -> Path:
    """ARKit's poses of the held-out pictures as TUM, at the times that an image folder gives its frames."""
    frames = held_out(open_scan(source, colored=False))
    count = len(frames)
    trajectory = Trajectory(
        np.arange(count) * FRAME_NS,
        np.full(count, PoseStatus.REGISTERED.value),
        np.ones(count, dtype=bool),
        np.array([frame.scan_from_camera.translation for frame in frames]),
        np.array([wxyz_of(frame.scan_from_camera.rotation) for frame in frames]),
    )
    write_tum(trajectory, path)
    return path
