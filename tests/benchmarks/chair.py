"""The real chair scan as scan and recording: every other picture plays the glasses, ARKit's poses are the truth.

The other half of the pictures stays with the phone. What a person recognises in several pictures is simulated by the
feature tracks of a reconstruction of all pictures, which nothing else here uses and which knows no pose of ARKit's.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from gazeloc_core.arrays import Floats, Ints
from gazeloc_core.camera import Camera
from gazeloc_core.export.tum import write_tum
from gazeloc_core.readers import open_scan
from gazeloc_core.scan import RoomScan, ScanFrame
from gazeloc_core.sfm import reconstruct
from gazeloc_core.trajectory import PoseStatus, Trajectory
from gazeloc_core.transforms import wxyz_of

FRAME_NS = 1_000_000_000
LEAST_IN_GLASSES, LEAST_IN_PHONE = 5, 3


@dataclass(frozen=True, eq=False)
class Place:
    """A distinct place in the pictures: where it is roughly (3,), in units of no meaning, and who sees it.

    `glasses` and `phone` are frames (n,) of the recording and of `frames_with_images`; their pixels are (n, 2), those
    of the phone in its own pictures.
    """

    rough: Floats
    glasses: Ints
    glasses_px: Floats
    phone: Ints
    phone_px: Floats


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
    _write_pictures(frames, camera, folder)
    (folder / "camera.json").write_text(json.dumps(camera.to_json()))
    return folder


def _write_pictures(frames: Sequence[ScanFrame], camera: Camera, folder: Path) -> list[str]:
    """The names of the pictures written."""
    folder.mkdir(parents=True)
    half = np.array([[1, 0, -0.5], [0, 1, -0.5], [0, 0, 1]])  # OpenCV counts from the first pixel's centre
    names = []
    for frame in frames:
        assert frame.image_path is not None
        common_from_own = half @ camera.matrix @ np.linalg.inv(frame.camera.matrix) @ np.linalg.inv(half)
        picture = cv2.warpAffine(
            cv2.imread(str(frame.image_path)), common_from_own[:2], (camera.width, camera.height), flags=cv2.INTER_CUBIC
        )
        names.append(frame.image_path.name)
        cv2.imwrite(str(folder / names[-1]), picture, [cv2.IMWRITE_JPEG_QUALITY, 95])
    return names


def find_places(source: Path, work: Path) -> list[Place]:
    """Places that are found to a pixel in enough pictures of either half, by a reconstruction of all pictures."""
    scan = open_scan(source, colored=False)
    frames, camera = scan.frames_with_images, common_camera(held_out(scan))
    names = _write_pictures(frames, camera, work / "pictures")
    model, *_ = reconstruct(work / "pictures", names, camera, np.arange(len(names)), work / "sfm")
    from_common = np.array([frame.camera.matrix @ np.linalg.inv(camera.matrix) for frame in frames])
    order = np.argsort(model.observation_point, kind="stable")
    starts = np.searchsorted(model.observation_point[order], np.arange(len(model.points) + 1))
    places = []
    for point in np.flatnonzero(model.point_errors_px < 1.0).tolist():
        rows = order[starts[point] : starts[point + 1]]
        frame, pixel = model.frame_indices[model.observation_image[rows]], model.observation_px[rows]
        in_time = np.argsort(frame)
        frame, pixel = frame[in_time], pixel[in_time]
        glasses = frame % 2 == 0
        if glasses.sum() >= LEAST_IN_GLASSES and (~glasses).sum() >= LEAST_IN_PHONE:
            phone = frame[~glasses]
            own = np.einsum("nij,nj->ni", from_common[phone], np.column_stack([pixel[~glasses], np.ones(len(phone))]))
            places.append(Place(model.points[point], frame[glasses] // 2, pixel[glasses], phone, own[:, :2]))
    return places


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
