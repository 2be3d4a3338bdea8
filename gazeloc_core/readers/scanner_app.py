"""3D Scanner App's "All Data" export: a mesh, and frames with ARKit poses, lidar depth and confidence.

Poses are row-major camera-to-world matrices in ARKit's axes (x right, y up, z backward): flipping the camera's y and z
on the right gives ours, and the world stays as it is. `transformToWorldMap` of info.json must not be applied (on the
maker's own sample it puts depth and mesh 1.7 m apart). Intrinsics follow OpenCV's pixel convention and belong to
the capture size, which the pictures may not have.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from gazeloc_core.camera import Camera
from gazeloc_core.errors import InputError
from gazeloc_core.progress import Report
from gazeloc_core.readers.depth_check import checked_against_depth
from gazeloc_core.readers.mesh_file import missing_pictures
from gazeloc_core.readers.obj_file import mesh_of, pictures_of, read_mtl, read_obj
from gazeloc_core.readers.pictures import camera_at_size, size_of
from gazeloc_core.scan import Mesh, RoomScan, ScanFrame
from gazeloc_core.storage.user_files import about, numbers_of, read_json_object
from gazeloc_core.transforms import rigid_from_matrix

FORMAT = "3D Scanner App"
FRAME_FILES = "frame_*.json"
MESHES = ("textured_output.obj", "export_refined.obj", "export.obj")
CAPTURE_SIZE = (1920, 1440)
ARKIT_FROM_CV = np.diag([1.0, -1.0, -1.0, 1.0])


def recognise(path: Path) -> str | None:
    """Why this is such an export, or None."""
    if not path.is_dir():
        return None
    count = len(list(path.glob(FRAME_FILES)))
    return f"it holds {count} files {FRAME_FILES}" if count else None


def read(path: Path, unit: str | None, up_axis: str | None, report: Report) -> RoomScan:
    """The scan, its depth checked against its mesh at the poses read here.

    Raises:
        InputError: for whatever is missing or damaged, and where depth and mesh disagree.
    """
    if unit not in (None, "m") or up_axis not in (None, "y"):
        raise InputError.of(path, "3D Scanner App writes metres with y up", "leave the unit and the up axis out")
    report(0.0, "reading poses")
    frames, notes = _read_frames(path)
    report(0.2, "reading the mesh")
    mesh, mesh_notes = _read_mesh(path)
    scan = RoomScan(path, FORMAT, mesh, frames, "y", (*notes, *mesh_notes))
    report(0.7, "checking depth against the mesh")
    return checked_against_depth(scan)


def _read_mesh(path: Path) -> tuple[Mesh, list[str]]:
    """The textured mesh if a picture of it is there, else the refined, else the raw one."""
    there = [name for name in MESHES if (path / name).is_file()]
    if not there:
        raise InputError.of(path, f"there is no mesh ({', '.join(MESHES)})", 'export "All Data" again')
    named = [picture for library in sorted(path.glob("*.mtl")) for picture in read_mtl(library).values()]
    notes = missing_pictures(named)
    if there[0] == MESHES[0]:
        obj = read_obj(path / MESHES[0])
        if len(there) == 1 or any(picture.is_file() for picture in pictures_of(obj).values()):
            return mesh_of(obj), [*notes, f"The mesh is {MESHES[0]}."]
        there = there[1:]
    return mesh_of(read_obj(path / there[0])), [*notes, f"The mesh is {there[0]}."]


def _read_frames(path: Path) -> tuple[tuple[ScanFrame, ...], list[str]]:
    files = sorted(path.glob(FRAME_FILES))
    assumed: list[str] = []
    frames = [_read_frame(file, assumed) for file in files]
    for before, after, file in zip(frames, frames[1:], files[1:], strict=False):
        if after.timestamp_ns <= before.timestamp_ns:
            problem = f"its time does not rise above that of {before.name}.json"
            raise InputError.of(file, problem, "remove the double frame or export again")
    pictures = sum(frame.image_path is not None for frame in frames)
    notes = [f"{len(frames)} posed frames, {pictures} of them with a picture."]
    if assumed:
        notes.append(assumed[0])
    if (path / "info.json").is_file():
        announced = read_json_object(path / "info.json").get("numImages")
        if isinstance(announced, int) and announced != len(frames):
            notes.append(f"info.json announces {announced} frames, {len(frames)} are there.")
    return tuple(frames), notes


def _read_frame(file: Path, assumed: list[str]) -> ScanFrame:
    value = read_json_object(file)
    matrix = numbers_of(file, value, "cameraPoseARFrame", 16).reshape(4, 4)
    with about(file):
        scan_from_camera = rigid_from_matrix(matrix @ ARKIT_FROM_CV, "cameraPoseARFrame")
    seconds = float(numbers_of(file, value, "time", 1)[0])
    picture = file.with_suffix(".jpg")
    number = file.stem.removeprefix("frame_")
    depth, confidence = file.with_name(f"depth_{number}.png"), file.with_name(f"conf_{number}.png")
    own = [path for path in (file, picture, depth, confidence) if path.is_file()]
    return ScanFrame(
        name=file.stem,
        timestamp_ns=round(seconds * 1e9),
        camera=_read_camera(file, value, picture if picture in own else None, assumed),
        scan_from_camera=scan_from_camera,
        image_path=picture if picture in own else None,
        depth_path=depth if depth in own else None,
        confidence_path=confidence if depth in own and confidence in own else None,
        own_files=tuple(own),
    )


def _read_camera(file: Path, value: dict[str, Any], picture: Path | None, assumed: list[str]) -> Camera:
    """The frame's camera at the size of its picture, or of the capture where it has none."""
    matrix = numbers_of(file, value, "intrinsics", 9).reshape(3, 3)
    size = size_of(picture) if picture is not None else None
    if "projectionMatrix" in value:
        projection = numbers_of(file, value, "projectionMatrix", 16).reshape(4, 4)
        with np.errstate(divide="ignore", invalid="ignore"):  # fx = P[0, 0] * width / 2, as ARKit defines it
            own = 2 * matrix[[0, 1], [0, 1]] / projection[[0, 1], [0, 1]]
        if not np.isfinite(own).all() or (own < 1).any():
            raise InputError.of(file, "intrinsics and projectionMatrix have no sensible size", "export again")
    else:
        own = np.array(min([size or CAPTURE_SIZE, CAPTURE_SIZE], key=lambda s: abs(2 * matrix[0, 2] / s[0] - 1)))
        assumed.append(
            f"Frames have no projectionMatrix: intrinsics are taken to be for {own[0]}x{own[1]}, by their centre."
        )
    width, height = (round(float(v)) for v in own)
    with about(file):
        camera = Camera.from_opencv(width, height, matrix, [])
    if size is None:
        return camera
    return camera_at_size(camera, size, file.with_suffix(".jpg"))
