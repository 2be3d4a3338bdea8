"""A room with painted walls, seen through a distorting lens from known poses, and a reconstruction of some of it.

A box of 5 x 2.6 x 4 m whose walls carry soft noise, so that every patch of a picture is unlike its neighbours. Pictures
are exact: one ray per pixel to the wall. Small, so that a test can look at dozens of them.
"""

from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from gazeloc_core.camera import Camera
from gazeloc_core.frames.undistort import undistorted_camera
from gazeloc_core.recording import Recording
from gazeloc_core.sfm_model import SfmModel
from gazeloc_core.transforms import Similarity

HALF = np.array([2.5, 1.3, 2.0])
LENS = Camera("FULL_OPENCV", 320, 300, np.array([225.0, 225.0, 160.0, 152.0, -0.126, 0.1, 0, 0, 0.02, 0.2, 0.15, 0.05]))
SFM_FROM_ROOM = Similarity(0.37, Rotation.from_rotvec([0.5, -1.1, 0.3]), np.array([1.0, -2.0, 0.5]))
STEP_NS = 33_000_000
START_NS = 1_700_000_000_123_456_789
_PAINT_PX_PER_M = 130


def head_poses(count: int, deg_per_frame: float = 1.0) -> RigidTransform:
    """A head that turns back and forth at up to this speed, nods, and walks a centimetre per frame."""
    t = np.arange(count)
    yaw = np.radians(deg_per_frame) * 8 * np.sin(t / 8)
    pitch = np.radians(deg_per_frame) * 4 * np.sin(t / 5 + 1)
    roll = np.radians(deg_per_frame) * 2 * np.sin(t / 9 + 2)
    turned = Rotation.from_euler("yxz", np.column_stack([yaw, pitch, roll]))
    places = np.column_stack([0.01 * t - 0.5, 0.02 * np.sin(t / 3), 0.3 * np.cos(t / 20)])
    return RigidTransform.from_components(places, turned)


def _paint() -> list[np.ndarray]:
    rng = np.random.default_rng(3)
    walls = []
    for _ in range(6):
        noise = sum(
            size * cv2.resize(rng.normal(size=(700 // size, 700 // size)).astype(np.float32), (700, 700)) / 6
            for size in (6, 16, 50)
        )
        walls.append(np.clip(128 + 16 * noise, 0, 255).astype(np.float32))
    return walls


PAINT = _paint()
_RAYS = LENS.unproject(LENS.pixel_centres())


def hits(origin: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where rays from inside meet the walls (N, 3), and which of the six walls (N,)."""
    with np.errstate(divide="ignore"):
        reach = (np.sign(directions) * HALF - origin) / directions
    axis = reach.argmin(axis=1)
    length = reach[np.arange(len(reach)), axis]
    return origin + length[:, None] * directions, 2 * axis + (
        np.take_along_axis(directions, axis[:, None], 1)[:, 0] > 0
    )


def picture(room_from_camera: RigidTransform) -> np.ndarray:
    """What the lens sees (H, W, 3)."""
    places, wall = hits(room_from_camera.translation, _RAYS @ room_from_camera.rotation.as_matrix().T)
    shape = (LENS.height, LENS.width)
    grey = np.zeros(shape, np.float32)
    for number, paint in enumerate(PAINT):
        along = [axis for axis in range(3) if axis != number // 2]
        u, v = ((places[:, along] + HALF.max() + 0.1) * _PAINT_PX_PER_M).T.astype(np.float32)
        painted = cv2.remap(paint, u.reshape(shape), v.reshape(shape), cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)
        grey = np.where((wall == number).reshape(shape), painted, grey)
    flat = np.clip(grey, 0, 255).astype(np.uint8)
    return np.repeat(flat[..., None], 3, axis=2)


@dataclass
class Pictures:
    """A source of frames: pictures from poses, some replaced by others. Counts what was read."""

    poses: RigidTransform
    instead: dict[int, np.ndarray] = field(default_factory=dict)
    read_frames: list[int] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.poses)

    def read(self, index: int) -> np.ndarray:
        self.read_frames.append(index)
        return self.instead[index] if index in self.instead else picture(self.poses[index])

    def iterate(self, indices):
        for index in indices:
            yield index, self.read(index)


def recording_of(frames: Pictures) -> Recording:
    """The recording of these frames, 33 ms apart."""
    times = START_NS + STEP_NS * np.arange(len(frames), dtype=np.int64)
    return Recording(Path("painted"), "made up", LENS, times, frames)


def model_of(poses: RigidTransform, images: list[int], per_image: int = 150, noise_px: float = 0.0) -> SfmModel:
    """The reconstruction of some frames: what each sees at random pixels, and where all others of them see that."""
    rng = np.random.default_rng(5)
    pinhole = undistorted_camera(LENS)
    points = []
    for image in images:
        pixels = rng.uniform((6, 6), (LENS.width - 6, LENS.height - 6), (per_image, 2))
        pose = poses[image]
        points.append(hits(pose.translation, LENS.unproject(pixels) @ pose.rotation.as_matrix().T)[0])
    in_room = np.concatenate(points)
    rows: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    for number, image in enumerate(images):
        in_camera = (in_room - poses[image].translation) @ poses[image].rotation.as_matrix()
        with np.errstate(invalid="ignore"):
            seen = np.flatnonzero(LENS.contains(LENS.project(in_camera)) & (in_camera[:, 2] > 0.3))
        pixels = pinhole.project(in_camera[seen]) + rng.normal(0, noise_px, (len(seen), 2))
        rows.append((seen, np.full(len(seen), number), pixels))
    point, image_of, px = (np.concatenate(column) for column in zip(*rows, strict=True))
    return SfmModel(
        cameras={1: pinhole},
        image_names=tuple(f"frame_{index:06d}.jpg" for index in images),
        image_camera_ids=np.ones(len(images), int),
        sfm_from_camera=SFM_FROM_ROOM.compose_pose(poses[images]),
        frame_indices=np.array(images),
        points=SFM_FROM_ROOM.apply(in_room),
        point_colors=np.zeros((len(in_room), 3), np.uint8),
        point_errors_px=np.full(len(in_room), 0.5),
        track_lengths=np.bincount(point, minlength=len(in_room)),
        observation_point=point,
        observation_image=image_of,
        observation_px=px,
    )
