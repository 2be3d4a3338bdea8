"""The phone's capture in the "All Data" layout of 3D Scanner App: frames, depth, confidence, poses that drift.

Layout as measured on a real export: `cameraPoseARFrame` is row-major camera-to-world in ARKit's axes (x right, y up,
z backward), intrinsics are OpenCV's (first pixel centre at (0, 0)) for the picture as stored, times are the device's
uptime.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any

import cv2
import numpy as np
from scipy.spatial.transform import RigidTransform

from gazeloc_core.arrays import Floats
from gazeloc_core.camera import HALF_PIXEL, Camera
from gazeloc_core.progress import Report
from gazeloc_core.synthesis.lidar import measured
from gazeloc_core.synthesis.paths import Drift
from gazeloc_core.synthesis.renderer import Rays, developed
from gazeloc_core.synthesis.room import Room, subpixels

ARKIT_FROM_CV = np.diag([1.0, -1.0, -1.0, 1.0])
UPTIME_S = 182634.25
NEAR_M = 0.001


@dataclass(frozen=True, eq=False)
class PhoneCapture:
    """The phone's frames: true and written poses, cameras, and times as they are written."""

    seconds: Floats
    """(N,) device uptime, of whole microseconds."""
    cameras: tuple[Camera, ...]
    true: RigidTransform
    written: RigidTransform


def plan(seconds: Floats, true: RigidTransform, wandering: Drift, size: tuple[int, int]) -> PhoneCapture:
    """The capture before anything is drawn; each frame's focal length breathes a little, as with autofocus."""
    width, height = size
    cameras = []
    for t in seconds:
        focal = width * 0.75397 * (1 + 0.0018 * np.sin(0.7 * t) + 0.0007 * np.sin(2.3 * t))
        cx, cy = width * (0.50314 + 0.0003 * np.sin(0.5 * t)), height * (0.4852 + 0.0004 * np.cos(0.6 * t))
        cameras.append(Camera.pinhole(width, height, focal, focal, cx, cy))
    return PhoneCapture(np.round(UPTIME_S + seconds, 6), tuple(cameras), true, wandering.reported(true))


def write(folder: FilePath, room: Room, capture: PhoneCapture, quality: int, seed: int, report: Report) -> None:
    """Draw and write all frames with depth and confidence; the mesh and `info.json` come from elsewhere."""
    folder.mkdir(parents=True, exist_ok=True)
    is_glass = np.array([p.name == "window" for p in room.patches])[room.patch_of_face]
    for index, camera in enumerate(capture.cameras):
        rng = np.random.default_rng([seed, index])
        pose = capture.true[index]
        radiance = np.zeros((camera.height, camera.width, 3), dtype=np.float32)
        offsets = subpixels(4)
        for offset in offsets:
            radiance += room.renderer.shoot(Rays(camera, offset), pose, footprint=0.5).radiance / len(offsets)
        image = developed(radiance, room.phone_exposure).astype(np.float32)
        image += rng.normal(0, 0.5, image.shape).astype(np.float32)
        bgr = np.clip(np.rint(image), 0, 255).astype(np.uint8)[..., ::-1]
        cv2.imwrite(str(folder / f"frame_{index:05d}.jpg"), bgr, [cv2.IMWRITE_JPEG_QUALITY, quality])
        depth, confidence = measured(room.renderer, camera, pose, is_glass, rng)
        best = [cv2.IMWRITE_PNG_COMPRESSION, 9]
        cv2.imwrite(str(folder / f"depth_{index:05d}.png"), depth, best)
        cv2.imwrite(str(folder / f"conf_{index:05d}.png"), confidence, best)
        text = json.dumps(_frame_json(capture, index), indent=2)
        (folder / f"frame_{index:05d}.json").write_text(text)
        report((index + 1) / len(capture.cameras), f"phone frame {index + 1} of {len(capture.cameras)}")


def _frame_json(capture: PhoneCapture, index: int) -> dict[str, Any]:
    camera, pose = capture.cameras[index], capture.written[index].as_matrix() @ ARKIT_FROM_CV
    (fx, fy), (cx, cy) = camera.focal_px, camera.principal_point_px - HALF_PIXEL
    projection = np.zeros((4, 4))
    projection[0, 0], projection[1, 1] = 2 * fx / camera.width, 2 * fy / camera.height
    projection[0, 2] = 1 - 2 * (cx + HALF_PIXEL) / camera.width
    projection[1, 2] = 2 * (cy + HALF_PIXEL) / camera.height - 1
    projection[2, 2], projection[2, 3], projection[3, 2] = -1.0, -NEAR_M, -1.0
    before = max(index - 1, 0)
    step = float(capture.seconds[index] - capture.seconds[before]) or 1.0
    moved = np.linalg.norm(capture.written[index].translation - capture.written[before].translation)
    turned = (capture.written[before].rotation.inv() * capture.written[index].rotation).magnitude()
    return {
        "exposureDuration": 1 / 61,
        "cameraPoseARFrame": [float(v) for v in pose.astype(np.float32).ravel()],
        "motionQuality": round(float(np.clip(1 - turned / step, 0, 1)), 6),
        "time": float(capture.seconds[index]),
        "frame_index": index,
        "projectionMatrix": [float(v) for v in projection.astype(np.float32).ravel()],
        "intrinsics": [float(v) for v in (fx, 0, cx, 0, fy, cy, 0, 0, 1)],
        "averageAngularVelocity": round(float(turned / step), 6),
        "cameraGrain": 0,
        "averageVelocity": round(float(moved / step), 6),
    }


def write_info(folder: FilePath, capture: PhoneCapture, faces: int, vertices: int) -> None:
    """`info.json`; its `transformToWorldMap` is SceneKit's and must not be applied to anything."""
    last = (capture.written[len(capture.cameras) - 1].as_matrix() @ ARKIT_FROM_CV).T
    names = [f"m{i}{j}" for i in range(1, 5) for j in range(1, 5)]
    info = {
        "title": "Made-up room",
        "appVersionString": "1.9.5",
        "appBuildString": "1",
        "numImages": len(capture.cameras),
        "numFaces": faces,
        "numVertices": vertices,
        "captureMode": 1,
        "captureResolution": -1,
        "projectVersion": 1,
        "editStatusTexturedModel": 2,
        "modifiedStatusRefinedModel": 1,
        "transformToWorldMap": dict(zip(names, np.eye(4).ravel().tolist(), strict=True)),
        "lastCameraPose": {name: round(float(v), 7) for name, v in zip(names, last.ravel(), strict=True)},
    }
    (folder / "info.json").write_text(json.dumps(info, indent=2))
