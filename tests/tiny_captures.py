"""Captures of a few frames in every format that the readers know, valid until a test damages them."""

import csv
import json
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import pycolmap
from scipy.spatial.transform import Rotation

from gazeloc_core.camera import Camera
from gazeloc_core.scan import Mesh
from gazeloc_core.surfaces.raycast import Raycaster

ROOM_M = np.array([4.0, 2.6, 3.0])
CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * ROOM_M
BOX_FACES = np.reshape(
    [0, 1, 3, 0, 3, 2, 4, 6, 7, 4, 7, 5, 0, 4, 5, 0, 5, 1, 2, 3, 7, 2, 7, 6, 0, 2, 6, 0, 6, 4, 1, 5, 7, 1, 7, 3],
    (12, 3),
)
MATRIX = [[60.0, 0.0, 31.2], [0.0, 60.5, 30.4], [0.0, 0.0, 1.0]]
DISTORTION = [-0.13, 0.11, 0.0004, -0.0003, 0.02, 0.17, 0.05, 0.03]
START_NS = 1_650_000_000_123_456_789
GAPS_MS = (33, 41, 29, 52, 33, 37, 60, 31, 44, 35, 33)
VIDEO_SIZE = (64, 62)


def box_mesh() -> Mesh:
    return Mesh(CORNERS, BOX_FACES)


def picture(width: int, height: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.kron(rng.integers(0, 255, (height // 8 + 1, width // 8 + 1, 3)), np.ones((8, 8, 1)))[
        :height, :width
    ].astype(np.uint8)


def write_scan(folder: Path, *, textured: bool = True, jpg: tuple[int, int] = (96, 72), frames: int = 4) -> Path:
    """A 3D Scanner App export of a box room; intrinsics are for 192x144, pictures half as large."""
    folder.mkdir(parents=True, exist_ok=True)
    uv = [(0, 0), (1, 0), (1, 1), (0, 1)]
    lines = ["mtllib textured_output.mtl", *(f"v {x} {y} {z}" for x, y, z in CORNERS), *(f"vt {u} {v}" for u, v in uv)]
    lines += ["usemtl material_0", *(f"f {a + 1}/1 {b + 1}/2 {c + 1}/3" for a, b, c in BOX_FACES)]
    (folder / ("textured_output.obj" if textured else "export.obj")).write_text("\n".join(lines) + "\n")
    (folder / "textured_output.mtl").write_text("newmtl material_0\nmap_Kd textured_output.jpg\n")
    if textured:
        cv2.imwrite(str(folder / "textured_output.jpg"), picture(64, 64, 9))
    (folder / "info.json").write_text(json.dumps({"numImages": frames}))
    caster = Raycaster(box_mesh())
    intrinsics = [[120.0, 0, 95.3], [0, 120.0, 70.1], [0, 0, 1]]
    lidar = Camera.from_opencv(192, 144, intrinsics, []).scaled(32, 24)
    rays = lidar.unproject(lidar.pixel_centres())
    rays /= rays[:, 2:]
    for i in range(frames):
        flip = np.diag([1.0, -1.0, -1.0])
        rotation = Rotation.from_euler("yx", [50.0 * i + 20, 10], degrees=True).as_matrix()  # ARKit axes
        centre = ROOM_M / 2 + [0.2 * i - 0.3, 0, 0.1 * i]
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = rotation, centre
        depth = caster.cast(centre, rays @ (rotation @ flip).T).distance.reshape(24, 32)
        cv2.imwrite(str(folder / f"depth_{i:05d}.png"), (depth * 1000).round().astype(np.uint16))
        cv2.imwrite(str(folder / f"conf_{i:05d}.png"), np.full((24, 32), 2, np.uint8))
        cv2.imwrite(str(folder / f"frame_{i:05d}.jpg"), picture(*jpg, i))
        projection = np.zeros((4, 4))
        projection[0, 0], projection[1, 1] = 2 * 120 / 192, 2 * 120 / 144
        value = {
            "cameraPoseARFrame": pose.ravel().tolist(),
            "intrinsics": np.ravel(intrinsics).tolist(),
            "projectionMatrix": projection.ravel().tolist(),
            "time": 402896.5 + 0.5 * i,
            "frame_index": i,
        }
        (folder / f"frame_{i:05d}.json").write_text(json.dumps(value))
    return folder


def frame_times_ns() -> list[int]:
    return [START_NS + 1_000_000 * int(ms) for ms in np.cumsum([0, *GAPS_MS])]


def write_video(path: Path, times_ns: list[int]) -> None:
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=30)
        stream.width, stream.height = VIDEO_SIZE
        stream.pix_fmt, stream.time_base = "yuv420p", Fraction(1, 1000)
        stream.codec_context.time_base = Fraction(1, 1000)
        for i, time_ns in enumerate(times_ns):
            frame = av.VideoFrame.from_ndarray(picture(*VIDEO_SIZE, i), format="rgb24")
            frame.pts, frame.time_base = (time_ns - times_ns[0]) // 1_000_000, Fraction(1, 1000)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())


def write_csv(path: Path, header: list[str], rows: list[list[object]]) -> None:
    with path.open("w", newline="") as file:
        csv.writer(file).writerows([header, *rows])


def write_recording(folder: Path) -> Path:
    """A Pupil Cloud export of 12 frames at a variable rate, with 20 samples of gaze."""
    folder.mkdir(parents=True, exist_ok=True)
    times = frame_times_ns()
    write_video(folder / "a1b2c3d4_0.0-0.5.mp4", times)
    write_csv(
        folder / "world_timestamps.csv",
        ["section id", "recording id", "timestamp [ns]"],
        [["s", "r", time] for time in times],
    )
    gaze = ["section id", "recording id", "timestamp [ns]", "gaze x [px]", "gaze y [px]", "worn", "fixation id"]
    rows = [["s", "r", START_NS + 5_000_000 * i, 20 + i, 30.25, 1, i // 5 or ""] for i in range(20)]
    write_csv(folder / "gaze.csv", gaze, rows)
    value = {"camera_matrix": MATRIX, "dist_coefs": [DISTORTION], "serial_number": "x"}
    (folder / "scene_camera.json").write_text(json.dumps(value))
    return folder


def write_image_folder(folder: Path, names: tuple[str, ...] = ("f_2.jpg", "f_10.jpg", "f_1.jpg")) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for i, name in enumerate(names):
        cv2.imwrite(str(folder / name), picture(*VIDEO_SIZE, i))
    camera = Camera.from_opencv(*VIDEO_SIZE, MATRIX, DISTORTION)
    (folder / "camera.json").write_text(json.dumps(camera.to_json()))
    return folder


def colmap_model(images: int = 5, points: int = 40) -> pycolmap.Reconstruction:
    """A model of COLMAP's own making, with tracks and with noise-free observations."""
    options = pycolmap.SyntheticDatasetOptions()
    options.num_rigs, options.num_cameras_per_rig = 1, 1
    options.num_frames_per_rig, options.num_points3D = images, points
    pycolmap.set_random_seed(4)
    return pycolmap.synthesize_dataset(options)


def write_colmap(folder: Path, kind: str = "binary") -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    getattr(colmap_model(), f"write_{kind}")(str(folder))
    return folder
