"""Which frame of a recording each image of a COLMAP model is, and whether the model's camera is the recording's.

What stays ambiguous is refused: a model joined to the wrong frames looks right and gives wrong gaze.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from gazeloc_core.arrays import Floats, Ints, frozen
from gazeloc_core.camera import Camera
from gazeloc_core.errors import InputError
from gazeloc_core.frames.sources import ImageFrames
from gazeloc_core.recording import Recording
from gazeloc_core.sfm_model import SfmModel
from gazeloc_core.storage.user_files import nanoseconds_of, read_csv

CSV_TOLERANCE_NS = 1_000_000
SAME_RAY_DEG = 0.5
ASK_FOR_CSV = "give a CSV with the columns name,timestamp_ns"
FIELD_MARGIN = 0.15
"""How far, in shares of the image's size, a cropped view may reach over the border of the recording's frames."""


def join_to_recording(
    model: SfmModel, recording: Recording, undistorted_camera: Camera, csv_path: Path | None = None
) -> Ints:
    """The frame index (K,) of each image of the model.

    By the CSV (`name,timestamp_ns`, within 1 ms) if there is one; by file name where the recording is image files;
    else by the last number in the image's name, counted from 0.

    Raises:
        InputError: if a name is missing, ambiguous, double or out of range, or a camera is not the recording's.
    """
    for camera_id in np.unique(model.image_camera_ids):
        check_same_camera(int(camera_id), model.cameras[int(camera_id)], recording.camera, undistorted_camera)
    if csv_path is not None:
        indices = _by_csv(model, recording, csv_path)
    else:
        by_name = _by_file_name(model, recording)
        indices = _by_number(model, recording) if by_name is None else by_name
    values, first, counts = np.unique(indices, return_index=True, return_counts=True)
    if (counts > 1).any():
        frame = int(values[counts > 1][0])
        names = [model.image_names[i] for i in np.flatnonzero(indices == frame)[:2]]
        raise InputError(
            f"The COLMAP images {names[0]} and {names[1]} both belong to frame {frame} of {recording.path}; "
            f"{ASK_FOR_CSV}."
        )
    assert len(first) == len(model)
    return frozen(indices, np.int64)


def _by_file_name(model: SfmModel, recording: Recording) -> Ints | None:
    if not isinstance(recording.frames, ImageFrames):
        return None
    index = {path.name: i for i, path in enumerate(recording.frames.paths)}
    found = [index.get(name.rsplit("/", 1)[-1]) for name in model.image_names]
    return None if any(i is None for i in found) else np.array(found, dtype=np.int64)


def _by_number(model: SfmModel, recording: Recording) -> Ints:
    numbers = []
    for name in model.image_names:
        groups = re.findall(r"\d+", name.rsplit("/", 1)[-1].rsplit(".", 1)[0])
        if not groups:
            raise InputError(f"The COLMAP image {name} has no frame number in its name; {ASK_FOR_CSV}.")
        numbers.append(int(groups[-1]))
    highest = max(numbers)
    if highest >= len(recording):
        hint = "it seems to count from 1; " if highest == len(recording) and min(numbers) >= 1 else ""
        raise InputError(
            f"The COLMAP image {model.image_names[numbers.index(highest)]} names frame {highest}, but "
            f"{recording.path} has the frames 0 to {len(recording) - 1}; {hint}number images from 0 or {ASK_FOR_CSV}."
        )
    return np.array(numbers, dtype=np.int64)


def _by_csv(model: SfmModel, recording: Recording, path: Path) -> Ints:
    columns = read_csv(path, ("name", "timestamp_ns"))
    times: dict[str, int] = {}
    stamps = nanoseconds_of(path, columns["timestamp_ns"])
    for line, (name, stamp) in enumerate(zip(columns["name"], stamps, strict=True), start=2):
        if name in times:
            raise InputError.of(path, f"row {line} names {name} again", "name each image once")
        times[name] = stamp
    missing = [name for name in model.image_names if name not in times]
    if missing:
        raise InputError.of(path, f"the COLMAP image {missing[0]} is not in it", "add a row for each image")
    wanted = np.array([times[name] for name in model.image_names], dtype=np.int64)
    own = recording.timestamp_ns
    after = np.clip(np.searchsorted(own, wanted), 1, max(len(own) - 1, 1)).astype(np.int64)
    before, after = after - 1, np.minimum(after, len(own) - 1)
    nearest = np.where(np.abs(own[before] - wanted) <= np.abs(own[after] - wanted), before, after)
    off = np.abs(own[nearest] - wanted)
    if (off > CSV_TOLERANCE_NS).any():
        worst = int(off.argmax())
        raise InputError.of(
            path,
            f"image {model.image_names[worst]} at {wanted[worst]} ns is {off[worst] / 1e6:.1f} ms off the nearest "
            "frame of the recording",
            "write the frames' own timestamps, to 1 ms",
        )
    return np.asarray(nearest, dtype=np.int64)


def check_same_camera(camera_id: int, camera: Camera, distorted: Camera, undistorted: Camera) -> None:
    """Refuse a model's camera that cannot have taken this recording's frames, distorted or undistorted.

    Of the same size (or the same shape, resized): rays over a grid of pixels within 0.5 degrees of one of the two.
    A pinhole of another shape, such as COLMAP's undistorter writes: its field of view lies in the recording's.

    Raises:
        InputError: with the angle between the rays.
    """
    angles = []
    for own in (distorted, undistorted):
        if abs(camera.width * own.height - camera.height * own.width) <= max(own.width, own.height):
            resized = own if camera.width == own.width else own.scaled(camera.width, camera.height)
            angles.append(_largest_angle_deg(camera, resized))
    if angles and min(angles) <= SAME_RAY_DEG:
        return
    if camera.is_pinhole and (camera.width, camera.height) != (undistorted.width, undistorted.height):
        if _field_lies_within(camera, distorted):
            return
        problem = "sees past the border of the recording's frames or only a small part of them"
    elif angles:
        problem = f"has rays up to {min(angles):.2f} degrees off the recording's camera (allowed: {SAME_RAY_DEG})"
    else:
        problem = f"has another shape than the recording's {distorted.width}x{distorted.height}"
    raise InputError(
        f"COLMAP's camera {camera_id} ({camera.model}, {camera.width}x{camera.height}) {problem}; reconstruct with "
        "the calibration of this recording, or give the recording that belongs to this model."
    )


def _grid(camera: Camera) -> Floats:
    x, y = np.meshgrid(np.linspace(0.5, camera.width - 0.5, 17), np.linspace(0.5, camera.height - 0.5, 17))
    return np.column_stack([x.ravel(), y.ravel()])


def _largest_angle_deg(first: Camera, second: Camera) -> float:
    a, b = first.unproject(_grid(first)), second.unproject(_grid(first))
    known = np.isfinite(a).all(axis=1) & np.isfinite(b).all(axis=1)
    if known.mean() < 0.9:
        return 180.0
    sine = np.linalg.norm(np.cross(a[known], b[known]), axis=1)
    return float(np.degrees(np.arctan2(sine, (a[known] * b[known]).sum(axis=1))).max())


def _field_lies_within(pinhole: Camera, distorted: Camera) -> bool:
    """Whether a pinhole's view stays within the frame (up to a margin) along its axes and fills at least half of it."""
    w, h = pinhole.width, pinhole.height
    cx, cy = pinhole.principal_point_px
    ends = distorted.project(pinhole.unproject([(0, cy), (w, cy), (cx, 0), (cx, h)]))
    size = np.array([distorted.width, distorted.height])
    inside = (ends >= -FIELD_MARGIN * size).all() and (ends <= (1 + FIELD_MARGIN) * size).all()
    share = np.array([ends[1, 0] - ends[0, 0], ends[3, 1] - ends[2, 1]]) / size
    return bool(np.isfinite(ends).all() and inside and (share >= 0.5).all())
