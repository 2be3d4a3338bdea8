"""The files of a Pupil Cloud export that other formats share: gaze.csv and scene_camera.json.

Pupil Labs counts pixels as OpenCV does, from (0, 0) at the first pixel's centre: half a pixel is added here.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gazeloc_core.arrays import Floats
from gazeloc_core.camera import HALF_PIXEL, Camera
from gazeloc_core.errors import InputError
from gazeloc_core.recording import Gaze
from gazeloc_core.storage.user_files import AGAIN, nanoseconds_of, numbers_of, read_csv, read_json_object

TIME = "timestamp [ns]"
COEFFICIENT_KEYS = ("dist_coefs", "distortion_coefficients")
"""The documents name the first, Pupil Labs' own code for Neon writes the second."""


def read_gaze(path: Path) -> Gaze:
    """The samples of a gaze.csv, in its order.

    Raises:
        InputError: if a column is missing, a cell is no number, or the times do not rise.
    """
    columns = read_csv(path, (TIME, "gaze x [px]", "gaze y [px]"))
    times = np.array(nanoseconds_of(path, columns[TIME]), dtype=np.int64)
    if (np.diff(times) < 0).any():
        row = int(np.flatnonzero(np.diff(times) < 0)[0]) + 3
        raise InputError.of(path, f"the time falls back at row {row}", AGAIN)
    pixels = np.column_stack([_floats(path, columns, f"gaze {axis} [px]") for axis in "xy"]) + HALF_PIXEL
    worn = _floats(path, columns, "worn") > 0 if "worn" in columns else None
    fixation = None
    if "fixation id" in columns:
        fixation = np.nan_to_num(_floats(path, columns, "fixation id")).astype(np.int64)
    return Gaze(times, pixels, worn, fixation)


def _floats(path: Path, columns: dict[str, list[str]], name: str) -> Floats:
    """The numbers of a column, NaN where a cell is empty."""
    words = {"": "nan", "true": "1", "false": "0"}
    try:
        numbers = np.array([words.get(text.lower(), text) for text in columns[name]], dtype=np.float64)
    except ValueError:
        for row, text in enumerate(columns[name], start=2):
            if not _is_number(words.get(text.lower(), text)):
                raise InputError.of(path, f"row {row} has {text!r} in the column {name!r}", AGAIN) from None
        raise
    if np.isinf(numbers).any():
        row = int(np.flatnonzero(np.isinf(numbers))[0]) + 2
        raise InputError.of(path, f"row {row} has an infinite value in the column {name!r}", AGAIN)
    return numbers


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def read_scene_camera(path: Path, size: tuple[int, int]) -> Camera:
    """The distorted camera of a scene_camera.json for frames of `size` (width, height), which the file does not say.

    Raises:
        InputError: if a field is missing or garbled, or the calibration cannot belong to frames of this size.
    """
    value = read_json_object(path)
    matrix = numbers_of(path, value, "camera_matrix", 9).reshape(3, 3)
    key = next((key for key in COEFFICIENT_KEYS if key in value), COEFFICIENT_KEYS[0])
    distortion = numbers_of(path, value, key)
    try:
        camera = Camera.from_opencv(*size, matrix, distortion)
    except InputError as error:
        raise InputError.of(path, str(error).rstrip("."), AGAIN) from error
    share = camera.principal_point_px / np.array(size)
    if (np.abs(share - 0.5) > 0.25).any():
        x, y = camera.principal_point_px
        problem = f"the principal point ({x:.0f}, {y:.0f}) is far off the centre of the frames, {size[0]}x{size[1]}"
        raise InputError.of(path, problem, "give the calibration that belongs to this recording")
    return camera
