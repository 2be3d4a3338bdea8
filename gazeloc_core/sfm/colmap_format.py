"""The files of a COLMAP model, binary or text, as they are written: cameras, images (camera from world) and points3D.

Both layouts are COLMAP's own (https://colmap.github.io/format.html) and the same in versions 3 and 4; the rigs and
frames files that newer versions add repeat what the images file says. They are parsed here and not by pycolmap, whose
C++ aborts the process on a truncated file instead of saying where it ends.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pycolmap

from gazeloc_core.arrays import Bytes, Floats, Ints
from gazeloc_core.camera import Camera
from gazeloc_core.errors import InputError
from gazeloc_core.storage.user_files import read_bytes, read_text

REMEDY = "write the model again with COLMAP"
MODEL_NAMES = {int(value): name for name, value in pycolmap.CameraModelId.__members__.items()}


@dataclass(frozen=True, eq=False)
class ModelImage:
    """One image as stored: rotation and translation `camera_from_world`, keypoints (M, 2), point ids (-1: none)."""

    image_id: int
    wxyz: Floats
    translation: Floats
    camera_id: int
    name: str
    keypoints_px: Floats
    point_ids: Ints


@dataclass(frozen=True, eq=False)
class ModelPoints:
    """The sparse points as stored: ids (P,), positions (P, 3), colours, mean reprojection errors, track lengths."""

    ids: Ints
    xyz: Floats
    rgb: Bytes
    errors_px: Floats
    track_lengths: Ints


class _Cursor:
    """Reads a binary file from front to back and says where it ends too early."""

    def __init__(self, path: Path):
        self.path = path
        self.data: bytes = read_bytes(path)
        self.at = 0

    def take(self, layout: str) -> tuple[Any, ...]:
        """The next values of a `struct` layout, little-endian."""
        return struct.unpack("<" + layout, self.chunk(struct.calcsize("<" + layout)))

    def chunk(self, size: int) -> bytes:
        """The next `size` bytes."""
        if self.at + size > len(self.data):
            raise InputError.of(self.path, f"the file is cut off at byte {len(self.data)}", REMEDY)
        self.at += size
        return self.data[self.at - size : self.at]

    def count(self, smallest_record: int) -> int:
        """The next count of records, refused where the rest of the file cannot hold that many."""
        (count,) = self.take("Q")
        if count * smallest_record > len(self.data) - self.at:
            raise InputError.of(
                self.path,
                f"the file announces {count} records but is cut off at byte {len(self.data)}",
                REMEDY,
            )
        return int(count)

    def name(self) -> str:
        """The next text that ends with a zero byte."""
        end = self.data.find(b"\0", self.at)
        if end < 0:
            raise InputError.of(self.path, f"the file is cut off at byte {len(self.data)}", REMEDY)
        text = self.chunk(end - self.at + 1)[:-1]
        try:
            return text.decode("utf-8")
        except UnicodeDecodeError as error:
            raise InputError.of(self.path, f"the image name {text[:40]!r} is not text", REMEDY) from error

    def finish(self) -> None:
        """Refuse what follows the last record."""
        if self.at != len(self.data):
            rest = len(self.data) - self.at
            raise InputError.of(self.path, f"{rest} bytes follow the last record; the file is damaged", REMEDY)


def read_cameras_binary(path: Path) -> dict[int, Camera]:
    """The cameras of `cameras.bin` by id."""
    cursor, cameras = _Cursor(path), {}
    for _ in range(cursor.count(24)):
        camera_id, model, width, height = cursor.take("IiQQ")
        name = MODEL_NAMES.get(model, str(model))
        known = name in pycolmap.CameraModelId.__members__ and name != "INVALID"
        if not known:
            raise InputError.of(path, f"camera {camera_id} has the unknown model number {model}", REMEDY)
        size = len(pycolmap.Camera.create_from_model_name(0, name, 1.0, 100, 100).params)
        cameras[camera_id] = _camera(path, camera_id, name, width, height, cursor.take(f"{size}d"))
    cursor.finish()
    return cameras


def read_images_binary(path: Path) -> list[ModelImage]:
    """The images of `images.bin`."""
    cursor, images = _Cursor(path), []
    for _ in range(cursor.count(73)):
        image_id, *pose, camera_id = cursor.take("I7dI")
        name = cursor.name()
        size = cursor.count(24)
        table = np.frombuffer(cursor.chunk(24 * size), dtype=[("xy", "<f8", 2), ("id", "<i8")])
        numbers = np.array(pose)
        images.append(ModelImage(image_id, numbers[:4], numbers[4:], camera_id, name, table["xy"], table["id"]))
    cursor.finish()
    return images


def read_points_binary(path: Path) -> ModelPoints:
    """The points of `points3D.bin`."""
    cursor = _Cursor(path)
    rows = []
    for _ in range(cursor.count(51)):
        row = cursor.take("Q3d3Bd")
        length = cursor.count(8)
        cursor.chunk(8 * length)
        rows.append((*row, length))
    cursor.finish()
    return _points(rows)


def read_cameras_text(path: Path) -> dict[int, Camera]:
    """The cameras of `cameras.txt` by id."""
    cameras = {}
    for number, line in _lines(path):
        words = line.split()
        if not words:
            continue
        try:
            camera_id, width, height = int(words[0]), int(words[2]), int(words[3])
            params = tuple(float(word) for word in words[4:])
        except (IndexError, ValueError) as error:
            problem = f"line {number} is not `CAMERA_ID MODEL WIDTH HEIGHT PARAMS...`"
            raise InputError.of(path, problem, REMEDY) from error
        cameras[camera_id] = _camera(path, camera_id, words[1], width, height, params)
    return cameras


def read_images_text(path: Path) -> list[ModelImage]:
    """The images of `images.txt`: two lines each, the second of which may be empty."""
    lines = list(_lines(path))
    while lines and not lines[0][1].strip():
        lines.pop(0)
    if len(lines) % 2:
        lines.append((len(lines) + 1, ""))  # editors strip the empty last line
    return [
        _image_of_text(path, *first, *second) for first, second in zip(lines[::2], lines[1::2], strict=True) if first[1]
    ]


def _image_of_text(path: Path, number: int, line: str, points_number: int, points_line: str) -> ModelImage:
    words = line.split(maxsplit=9)
    try:
        image_id, camera_id, name = int(words[0]), int(words[8]), words[9].strip()
        pose = np.array([float(word) for word in words[1:8]])
    except (IndexError, ValueError) as error:
        problem = f"line {number} is not `IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME`"
        raise InputError.of(path, problem, REMEDY) from error
    try:
        table = np.array(points_line.split(), dtype=np.float64).reshape(-1, 3)
    except ValueError as error:
        problem = f"line {points_number} is not the list `X Y POINT3D_ID ...` of image {name}; each image has two lines"
        raise InputError.of(path, problem, REMEDY) from error
    ids = table[:, 2].astype(np.int64)
    return ModelImage(image_id, pose[:4], pose[4:], camera_id, name, table[:, :2], ids)


def read_points_text(path: Path) -> ModelPoints:
    """The points of `points3D.txt`."""
    rows: list[tuple[Any, ...]] = []
    for number, line in _lines(path):
        words = line.split()
        if not words:
            continue
        try:
            if len(words) % 2:
                raise ValueError
            xyz, rgb = [float(word) for word in words[1:4]], [int(word) for word in words[4:7]]
            rows.append((int(words[0]), *xyz, *rgb, float(words[7]), (len(words) - 8) // 2))
        except (IndexError, ValueError) as error:
            problem = f"line {number} is not `POINT3D_ID X Y Z R G B ERROR TRACK...`"
            raise InputError.of(path, problem, REMEDY) from error
    return _points(rows)


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        if not line.startswith("#"):
            yield number, line


def _camera(path: Path, camera_id: int, model: str, width: int, height: int, params: tuple[float, ...]) -> Camera:
    try:
        return Camera(model, width, height, np.array(params))
    except InputError as error:
        raise InputError.of(path, f"camera {camera_id}: {str(error).rstrip('.')}", REMEDY) from error


def _points(rows: list[tuple[Any, ...]]) -> ModelPoints:
    table = np.array(rows, dtype=np.float64).reshape(-1, 9)
    return ModelPoints(
        ids=np.array([row[0] for row in rows], dtype=np.int64),
        xyz=table[:, 1:4],
        rgb=np.clip(table[:, 4:7], 0, 255).astype(np.uint8),
        errors_px=table[:, 7],
        track_lengths=table[:, 8].astype(np.int64),
    )
