"""Aligned poses as nerfstudio's transforms.json, with the undistorted frames beside it.

nerfstudio's cameras look along -z with y up (OpenGL), ours along z with y down: a camera's axes y and z change sign.
Its lens models lack k5 and k6 of the glasses' rational model, so frames are undistorted to a pinhole camera first.
Its principal point has the first pixel centre at (0.5, 0.5), as ours. Train with `--auto-scale-poses False` (and
`--orientation-method none --center-method none`) to stay in the scan's metres and axes.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from gazeloc_core.arrays import Bytes, Floats
from gazeloc_core.camera import Camera
from gazeloc_core.errors import GeometryError, InputError
from gazeloc_core.export.frame_notes import FrameNotes
from gazeloc_core.progress import Report, silent
from gazeloc_core.storage.export_files import move_all, refuse_foreign, staging_folder
from gazeloc_core.trajectory import PoseStatus, Trajectory

FILE_NAME = "transforms.json"
IMAGE_FOLDER = "images"
GENERATOR = "gazeloc"
CAMERA_FROM_GL = np.diag([1.0, -1.0, -1.0, 1.0])


def registered_frames(trajectory: Trajectory) -> list[int]:
    """The frames that training should see: measured ones, not those tracked between keyframes, which are sharper."""
    wanted = trajectory.is_localised & (trajectory.status != PoseStatus.TRACKED.value)
    return [int(index) for index in np.flatnonzero(wanted)]


def write_nerfstudio(
    trajectory: Trajectory,
    pinhole: Camera,
    folder: Path,
    *,
    undistorted: Iterable[tuple[int, Bytes]] | None = None,
    file_paths: Mapping[int, str] | None = None,
    notes: FrameNotes | None = None,
    overwrite: bool = False,
    report: Report = silent,
) -> list[Path]:
    """Write `folder`/transforms.json for `registered_frames`; the list of files written.

    `undistorted` gives their pictures (index, (H, W, 3) RGB of the camera `pinhole`), which are written to
    `folder`/images. Without it, `file_paths` names pictures that are there already, by frame index. `notes` go beside
    their frames, where other programs read over them.

    Raises:
        GeometryError: if no frame was registered, or `pinhole` has distortion.
        InputError: if a transforms.json is there that GazeLoc did not write, a picture is missing or of another size,
            or the folder cannot be written.
    """
    if not pinhole.is_pinhole:
        raise GeometryError(f"transforms.json needs undistorted frames, but the camera is {pinhole.model}.")
    frames = registered_frames(trajectory)
    if not frames:
        raise GeometryError("No frame of the recording was registered, there is nothing to export; align first.")
    refuse_foreign(folder / FILE_NAME, _is_ours, overwrite=overwrite)
    with staging_folder(folder) as staging:
        paths = dict(file_paths or {})
        if undistorted is not None:
            paths = _write_images(undistorted, frames, pinhole, staging, report)
        if missing := [index for index in frames if index not in paths]:
            raise InputError(f"Frame {missing[0]} is registered but has no undistorted picture; undistort it first.")
        content = json.dumps(
            _content(trajectory, frames, paths, pinhole, notes or FrameNotes()), indent=1, allow_nan=False
        )
        (staging / FILE_NAME).write_text(content + "\n", encoding="utf-8")
        return move_all(staging, folder)


def gl_pose(trajectory: Trajectory, index: int) -> Floats:
    """The 4x4 matrix from the OpenGL camera of one frame to the scan."""
    pose = trajectory.poses(np.array([index]))
    return np.asarray(pose.as_matrix()[0] @ CAMERA_FROM_GL, dtype=np.float64)


def _content(
    trajectory: Trajectory, frames: list[int], paths: Mapping[int, str], pinhole: Camera, notes: FrameNotes
) -> dict[str, Any]:
    (fx, fy), (cx, cy) = (values.tolist() for values in (pinhole.focal_px, pinhole.principal_point_px))
    return {
        "generator": GENERATOR,
        "camera_model": "OPENCV",
        "w": pinhole.width,
        "h": pinhole.height,
        "fl_x": fx,
        "fl_y": fy,
        "cx": cx,
        "cy": cy,
        "k1": 0.0,
        "k2": 0.0,
        "p1": 0.0,
        "p2": 0.0,
        "frames": [
            {
                "file_path": paths[index],
                "transform_matrix": gl_pose(trajectory, index).tolist(),
                "frame_index": index,
                "timestamp_ns": int(trajectory.timestamp_ns[index]),
                **notes.values(index),
            }
            for index in frames
        ],
    }


def _write_images(
    undistorted: Iterable[tuple[int, Bytes]], frames: list[int], pinhole: Camera, staging: Path, report: Report
) -> dict[int, str]:
    (staging / IMAGE_FOLDER).mkdir()
    wanted, paths = set(frames), {}
    for index, image in undistorted:
        if index not in wanted:
            continue
        if image.shape[:2] != (pinhole.height, pinhole.width):
            raise InputError(
                f"Undistorted frame {index} is {image.shape[1]}x{image.shape[0]}, its camera "
                f"{pinhole.width}x{pinhole.height}; undistort again."
            )
        paths[index] = f"{IMAGE_FOLDER}/frame_{index:06d}.png"
        if not cv2.imwrite(str(staging / paths[index]), cv2.cvtColor(image, cv2.COLOR_RGB2BGR)):
            raise OSError(None, f"{paths[index]} was not written")
        report(len(paths) / len(frames), f"frame {index}")
    return paths


def _is_ours(path: Path) -> bool:
    try:
        value = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return isinstance(value, dict) and value.get("generator") == GENERATOR
