"""The glasses' recording in the layout of a Pupil Cloud "Timeseries Data + Scene Video" export of a Pupil Invisible.

Each frame is drawn through the distorted lens itself, one ray per pixel. Motion blur: the exposure is cut into parts,
a shot is taken in the middle of each, and smeared along the pixels' own paths over that part (so that only what a shot
cannot see behind an edge is approximate). Then shot noise, read noise, and the sRGB curve of a dim picture.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path as FilePath

import av
import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform

from gazeloc_core.arrays import Bytes, Floats, Ints
from gazeloc_core.camera import Camera
from gazeloc_core.progress import Report
from gazeloc_core.synthesis.paths import Path
from gazeloc_core.synthesis.renderer import BAND_ROWS, Rays, developed
from gazeloc_core.synthesis.room import Room, subpixels

MATRIX = ((766.28, 0.0, 543.63), (0.0, 766.41, 541.07), (0.0, 0.0, 1.0))
"""OpenCV's convention: first pixel centre at (0, 0)."""
DISTORTION = (-0.1257, 0.1009, 0.0004, -0.0005, 0.0077, 0.2101, 0.0090, 0.0152)
"""k1 k2 p1 p2 k3 k4 k5 k6; rises all the way to the corners."""
SIZE = (1088, 1080)
START_NS = 1_712_311_204_118_000_000
TIME_BASE = Fraction(1, 90_000)
SHOT_SPAN_PX = 9.0
"""The longest path that one shot is smeared along."""
MAX_SHOTS = 3
SMEAR_STEP_PX = 0.9
MOTION_GRID_PX = 16


@dataclass(frozen=True, eq=False)
class GlassesCapture:
    """The recording before anything is drawn."""

    camera: Camera
    timestamp_ns: Ints
    path: Path
    scan_from_room: RigidTransform
    exposure_s: float

    def poses_at(self, timestamp_ns: Ints) -> RigidTransform:
        """True `scan_from_camera` at times (T,) of the recording's clock."""
        seconds = (np.asarray(timestamp_ns) - START_NS) / 1e9
        return self.scan_from_room * self.path.poses(seconds)


def lens(size: tuple[int, int] = SIZE) -> Camera:
    """The scene camera, for smaller pictures too."""
    return Camera.from_opencv(*SIZE, MATRIX, DISTORTION).scaled(*size)


def frame_times(seconds: float, rate_hz: float, seed: int) -> Ints:
    """Times of the frames in ns: about `rate_hz` with jitter, and now and then a dropped frame."""
    rng = np.random.default_rng(seed)
    count = int(seconds * rate_hz)
    steps = np.arange(count) / rate_hz + rng.normal(0, 0.0006, count)
    kept = np.sort(rng.choice(count, size=count - max(1, count // 150), replace=False))
    kept[0] = 0
    ns = START_NS + np.rint(np.maximum(steps[np.unique(kept)], 0) * 1e9).astype(np.int64)
    return np.asarray(ns)


def write_video(
    file: FilePath, room: Room, capture: GlassesCapture, gain: float, crf: int, seed: int, report: Report
) -> None:
    """Draw and encode all frames; each keeps its own time (variable rate), pts counted from the first frame."""
    times = capture.timestamp_ns
    with av.open(str(file), "w", options={"fflags": "+bitexact", "movflags": "+faststart"}) as container:
        stream = container.add_stream("libx264", rate=30)
        stream.width, stream.height, stream.pix_fmt = capture.camera.width, capture.camera.height, "yuv420p"
        stream.time_base = stream.codec_context.time_base = TIME_BASE
        stream.options = {"crf": str(crf), "preset": "medium", "bf": "0", "g": "60", "threads": "1"}
        stream.codec_context.thread_count = 1
        for index, image in enumerate(_frames(room, capture, gain, seed)):
            frame = av.VideoFrame.from_ndarray(image, format="rgb24")
            frame.pts = presentation_time(int(times[index] - times[0]))
            frame.time_base = TIME_BASE
            container.mux(stream.encode(frame))
            report((index + 1) / len(times), f"glasses frame {index + 1} of {len(times)}")
        container.mux(stream.encode())


def presentation_time(elapsed_ns: int) -> int:
    """The pts, in units of `TIME_BASE`, of a frame that long after the first."""
    return round(elapsed_ns * TIME_BASE.denominator / 1e9)


def _frames(room: Room, capture: GlassesCapture, gain: float, seed: int) -> Iterator[Bytes]:
    camera = capture.camera
    bundles = shot_rays(camera)
    for index, time in enumerate(capture.timestamp_ns.tolist()):
        rng = np.random.default_rng([seed, index])
        yield noisy(exposed(room, capture, bundles, time), gain, rng)


def shot_rays(camera: Camera) -> dict[int, list[Rays]]:
    """The rays of each shot, by the number of shots; whatever the number, their mean is the pixel's centre."""
    return {count: [Rays(camera, offset) for offset in subpixels(count)] for count in range(1, MAX_SHOTS + 1)}


def exposed(room: Room, capture: GlassesCapture, bundles: dict[int, list[Rays]], time_ns: int) -> NDArray[np.float32]:
    """Linear radiance (h, w, 3) gathered over an exposure that is centred on `time_ns`."""
    whole = int(capture.exposure_s * 1e9)
    ends = capture.poses_at(np.array([time_ns - whole // 2, time_ns, time_ns + whole // 2]))
    longest = float(np.abs(_motion(capture.camera, ends[1], ends[0], ends[2], None)).max())
    shots = int(np.clip(np.ceil(longest / SHOT_SPAN_PX), 1, MAX_SHOTS))
    total = np.zeros((capture.camera.height, capture.camera.width, 3), dtype=np.float32)
    for k in range(shots):
        part = whole // shots
        begin = time_ns - whole // 2 + k * part
        a, b, c = capture.poses_at(np.array([begin, begin + part // 2, begin + part]))
        shot = room.renderer.shoot(bundles[shots][k], b)
        motion = _motion(capture.camera, b, a, c, shot.depth)
        total += _smeared(shot.radiance, motion) / shots
    return total


def _motion(
    camera: Camera,
    scan_from_middle: RigidTransform,
    scan_from_begin: RigidTransform,
    scan_from_end: RigidTransform,
    depth: NDArray[np.float32] | None,
) -> NDArray[np.float32]:
    """How far each point of a coarse grid of pixels moves during the exposure, (rows, columns, 2) px."""
    pixels = motion_grid(camera)
    far = np.full(len(pixels), 2.0)
    if depth is not None:
        x, y = pixels.astype(int).T
        far = np.where(np.isfinite(depth[y, x]), depth[y, x], 10.0)
    poses = RigidTransform.concatenate([scan_from_begin, scan_from_middle, scan_from_end])
    rows = len(range(MOTION_GRID_PX // 2, camera.height, MOTION_GRID_PX))
    return np.asarray(moved_px(camera, pixels, far, poses).reshape(rows, -1, 2), dtype=np.float32)


def motion_grid(camera: Camera) -> Floats:
    """The pixels (G, 2) at which motion is measured, row by row."""
    xs = np.arange(MOTION_GRID_PX / 2, camera.width, MOTION_GRID_PX)
    ys = np.arange(MOTION_GRID_PX / 2, camera.height, MOTION_GRID_PX)
    return np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2)


def moved_px(camera: Camera, pixels: Floats, depth: Floats, poses: RigidTransform) -> Floats:
    """How far (G, 2) what lies at `depth` (G,) behind pixels (G, 2) moves from the first of three poses to the last.

    The pixels are those of the second pose; all three are `scan_from_camera`.
    """
    rays = camera.unproject(pixels)
    points = poses[1].apply(rays / rays[:, 2:] * depth[:, None])
    begin, end = (camera.project(pose.inv().apply(points)) for pose in (poses[0], poses[2]))
    return np.asarray(np.nan_to_num(end - begin))


def _smeared(radiance: NDArray[np.float32], motion: NDArray[np.float32]) -> NDArray[np.float32]:
    """The picture averaged along each pixel's path."""
    steps = int(np.ceil(float(np.abs(motion).max()) / SMEAR_STEP_PX))
    if steps <= 1:
        return radiance
    height, width = radiance.shape[:2]
    flow = cv2.resize(motion, (width, height), interpolation=cv2.INTER_LINEAR)
    here = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).astype(np.float32)
    total = np.zeros_like(radiance)
    for s in (np.arange(steps) + 0.5) / steps - 0.5:
        for top in range(0, height, BAND_ROWS):
            band = slice(top, top + BAND_ROWS)
            spot = here[band] - np.float32(s) * flow[band]
            total[band] += cv2.remap(radiance, spot, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return total / np.float32(steps)


def noisy(radiance: NDArray[np.float32], gain: float, rng: np.random.Generator) -> Bytes:
    """The picture of a small, dim sensor: noise whose variance grows with light, plus read noise; then the curve."""
    picture = np.empty(radiance.shape, dtype=np.uint8)
    for top in range(0, len(radiance), BAND_ROWS):
        signal = radiance[top : top + BAND_ROWS] * np.float32(gain)
        noise = rng.standard_normal(signal.shape, dtype=np.float32)
        noise *= np.sqrt(signal * np.float32(9e-5) + np.float32(4e-6))
        picture[top : top + BAND_ROWS] = developed(signal + noise, 1.0)
    return picture


def write_camera(folder: FilePath, capture: GlassesCapture) -> None:
    """`scene_camera.json`, OpenCV's convention."""
    scale_x, scale_y = capture.camera.width / SIZE[0], capture.camera.height / SIZE[1]
    matrix = np.array(MATRIX)
    matrix[0, 0] *= scale_x
    matrix[1, 1] *= scale_y
    matrix[0, 2] = (matrix[0, 2] + 0.5) * scale_x - 0.5
    matrix[1, 2] = (matrix[1, 2] + 0.5) * scale_y - 0.5
    value = {
        "camera_matrix": matrix.tolist(),
        "dist_coefs": [list(DISTORTION)],
        "rotation_matrix": np.eye(3).tolist(),
        "serial_number": "5am9e",
        "version": "1.0",
    }
    (folder / "scene_camera.json").write_text(json.dumps(value, indent=2))
