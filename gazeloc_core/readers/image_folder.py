"""A folder of images with a camera file, as a recording.

Camera files: `camera.json` (GazeLoc's own), `scene_camera.json` (Pupil's) or `cameras.txt` (COLMAP's, one camera).
Beside them may lie `timestamps.csv` (`name,timestamp_ns`) and `gaze.csv` (Pupil's columns).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gazeloc_core.arrays import Ints
from gazeloc_core.camera import Camera
from gazeloc_core.errors import InputError
from gazeloc_core.frames.sources import ImageFrames
from gazeloc_core.readers.pictures import size_of
from gazeloc_core.readers.pupil_files import read_gaze, read_scene_camera
from gazeloc_core.recording import Recording
from gazeloc_core.sfm.colmap_format import read_cameras_text
from gazeloc_core.storage.user_files import nanoseconds_of, natural_key, read_csv, read_json_object

FORMAT = "image folder"
CAMERA_FILES = ("camera.json", "scene_camera.json", "cameras.txt")
IMAGE_ENDINGS = (".jpg", ".jpeg", ".png")
SPACING_NS = 1_000_000_000


def recognise(path: Path) -> str | None:
    """Why this is a folder of images with a camera file, or None."""
    if not path.is_dir():
        return None
    images, camera = images_in(path), _camera_file(path)
    if not images or camera is None:
        return None
    return f"it holds {len(images)} images and {camera.name}"


def read(path: Path) -> Recording:
    """The recording; without `timestamps.csv` its frames get 1 s spacing in natural order of their names.

    Raises:
        InputError: for whatever is missing or does not fit together.
    """
    images = images_in(path)
    camera_file = _camera_file(path)
    if not images or camera_file is None:
        raise InputError.of(path, "there are no images with a camera file", "add " + " or ".join(CAMERA_FILES))
    camera = _read_camera(camera_file, size_of(images[0]))
    for image in images:
        if (size := size_of(image)) != (camera.width, camera.height):
            problem = f"the picture is {size[0]}x{size[1]} but its camera {camera.width}x{camera.height}"
            raise InputError.of(image, problem, "remove it or give the camera file that belongs to these images")
    notes = []
    if (path / "timestamps.csv").is_file():
        images, times = _in_order_of_time(path / "timestamps.csv", images)
    else:
        times = np.arange(len(images)) * SPACING_NS
        notes.append("The images have no timestamps.csv: frames are 1 s apart, in natural order of their names.")
    gaze = read_gaze(path / "gaze.csv") if (path / "gaze.csv").is_file() else None
    return Recording(path, FORMAT, camera, times, ImageFrames(tuple(images), camera), gaze, tuple(notes))


def images_in(folder: Path) -> list[Path]:
    """The images of a folder in natural order of their names."""
    files = [p for p in folder.iterdir() if p.suffix.lower() in IMAGE_ENDINGS and not p.name.startswith(".")]
    return sorted(files, key=lambda p: natural_key(p.name))


def _camera_file(path: Path) -> Path | None:
    return next((path / name for name in CAMERA_FILES if (path / name).is_file()), None)


def _read_camera(path: Path, size: tuple[int, int]) -> Camera:
    if path.name == "scene_camera.json":
        return read_scene_camera(path, size)
    if path.name == "camera.json":
        value = read_json_object(path)
        try:
            return Camera.from_json(value)
        except InputError as error:
            raise InputError.of(path, str(error).rstrip("."), "write it with Camera.to_json") from error
    cameras = read_cameras_text(path)
    if len(cameras) != 1:
        raise InputError.of(path, f"it holds {len(cameras)} cameras, expected 1", "keep the camera of these images")
    return next(iter(cameras.values()))


def _in_order_of_time(path: Path, images: list[Path]) -> tuple[list[Path], Ints]:
    columns = read_csv(path, ("name", "timestamp_ns"))
    stamps = nanoseconds_of(path, columns["timestamp_ns"])
    times = dict(zip(columns["name"], stamps, strict=True))
    if len(times) != len(stamps):
        double = next(name for name in times if columns["name"].count(name) > 1)
        raise InputError.of(path, f"{double} is named twice", "name each image once")
    by_name = {image.name: image for image in images}
    for name in times:
        if name not in by_name:
            raise InputError.of(path, f"it names {name}, which is not there", "restore the image or remove the row")
    missing = next((name for name in by_name if name not in times), None)
    if missing is not None:
        problem = f"{len(images)} images but {len(times)} timestamps; {missing} has none"
        raise InputError.of(path, problem, "add a row for each image")
    names = sorted(times, key=lambda name: times[name])
    return [by_name[name] for name in names], np.array([times[name] for name in names], dtype=np.int64)
