"""ARKitScenes video folders (Apple, NeurIPS 2021), 3DOD or raw: a mesh, a trajectory, pictures, depth and confidence.

    <video>/<video>_3dod_mesh.ply                    ARKit's mesh with colours, metres, z up
    <video>/<video>_frames/ (3DOD) or <video>/ (raw)
      lowres_wide.traj                               about 10 poses a second: world to camera, axis-angle and metres
      wide/ vga_wide/ lowres_wide/                   <video>_<seconds>.png: 1920x1440, 640x480, 256x192
      <pictures>_intrinsics/                         <video>_<seconds>.pincam: width height fx fy cx cy
      lowres_depth/ confidence/                      uint16 in millimetres; 0, 1 or 2

Apple's own loader (threedod/benchmark_scripts/utils/tenFpsDataLoader.py) inverts the pose and back-projects column u of
the picture as (u - cx) / fx, so its axes are ours (x right, y down, z forward) and its first pixel's centre is (0, 0):
half a pixel is added here. It takes a pose that is at most 5 ms off a picture, and intrinsics whose time in the name is
a millisecond off; so does this reader, and pictures without such a pose are left out: nothing is interpolated.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from gazeloc_core.arrays import Floats, Ints
from gazeloc_core.camera import Camera
from gazeloc_core.errors import InputError
from gazeloc_core.progress import Report
from gazeloc_core.readers.depth_check import checked_against_depth
from gazeloc_core.readers.mesh_file import mesh_through_trimesh
from gazeloc_core.readers.pictures import camera_at_size, size_of
from gazeloc_core.scan import Mesh, RoomScan, ScanFrame
from gazeloc_core.storage.user_files import about, read_text
from gazeloc_core.times import nearest_rows
from gazeloc_core.transforms import rigid

FORMAT = "ARKitScenes"
TRAJECTORY = "lowres_wide.traj"
MESH = "*_3dod_mesh.ply"
PICTURES = ("wide", "vga_wide", "lowres_wide")
"""Folders of pictures, the best first."""
POSE_TOLERANCE_NS = 5_000_000
INTRINSICS_TOLERANCE_NS = 1_500_000
AGAIN = "download the video again"
_NAME = re.compile(r".*_(\d{1,9}(?:\.\d{1,9})?)")


@dataclass(frozen=True, eq=False)
class _Asset:
    """The files of one folder in order of the times (N,) in their names."""

    timestamp_ns: Ints
    paths: tuple[Path, ...]

    @classmethod
    def of(cls, folder: Path) -> _Asset:
        files = [p for p in folder.iterdir() if p.is_file() and not p.name.startswith(".")] if folder.is_dir() else []
        named = sorted((int(Decimal(match[1]).scaleb(9)), p) for p in files if (match := _NAME.fullmatch(p.stem)))
        return cls(np.array([time for time, _ in named], dtype=np.int64), tuple(path for _, path in named))

    def near(self, time_ns: int, tolerance_ns: int) -> Path | None:
        """The file nearest to a time, if one is within the tolerance."""
        row = int(nearest_rows(np.array([time_ns]), self.timestamp_ns, tolerance_ns)[0])
        return None if row < 0 else self.paths[row]


def recognise(path: Path) -> str | None:
    """Why this is the folder of an ARKitScenes video, or None."""
    frames = _frames_folder(path)
    return None if frames is None else f"it holds {(frames / TRAJECTORY).relative_to(path).as_posix()}"


def read(path: Path, unit: str | None, up_axis: str | None, report: Report) -> RoomScan:
    """The scan, its depth checked against its mesh at the poses read here.

    Raises:
        InputError: for whatever is missing or damaged, and where depth and mesh disagree.
    """
    if unit not in (None, "m") or up_axis not in (None, "z"):
        raise InputError.of(path, "ARKitScenes is in metres with z up", "leave the unit and the up axis out")
    folder = _frames_folder(path)
    if folder is None:
        raise InputError.of(path, f"there is no {TRAJECTORY}", AGAIN)
    report(0.0, "reading poses")
    times, poses = _read_trajectory(folder / TRAJECTORY)
    frames, note = _read_frames(folder, times, poses)
    report(0.3, "reading the mesh")
    scan = RoomScan(path, FORMAT, _read_mesh(path), frames, "z", (note,))
    report(0.7, "checking depth against the mesh")
    return checked_against_depth(scan)


def _frames_folder(path: Path) -> Path | None:
    if not path.is_dir():
        return None
    candidates = [path, *sorted(p for p in path.glob("*_frames") if p.is_dir())]
    return next((folder for folder in candidates if (folder / TRAJECTORY).is_file()), None)


def _read_mesh(path: Path) -> Mesh:
    meshes = sorted(path.glob(MESH))
    if len(meshes) != 1:
        raise InputError.of(path, f"there are {len(meshes)} meshes {MESH}, expected 1", AGAIN)
    with about(meshes[0]):
        return mesh_through_trimesh(meshes[0])


def _read_trajectory(path: Path) -> tuple[Ints, RigidTransform]:
    """Times (N,) in nanoseconds and `scan_from_camera` (N,)."""
    times: list[int] = []
    rows: list[Floats] = []
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        if not line.strip():
            continue
        values = line.split()
        if len(values) != 7:
            raise InputError.of(path, f"line {number} has {len(values)} values, expected 7", AGAIN)
        try:
            row = np.array([float(value) for value in values])
        except ValueError as error:
            raise InputError.of(path, f"line {number} holds something that is not a number", AGAIN) from error
        if not np.isfinite(row).all() or abs(row[0]) > 1e9:
            raise InputError.of(path, f"line {number} holds a value that is not finite", AGAIN)
        times.append(round(Decimal(values[0]).scaleb(9)))
        rows.append(row)
        if len(times) > 1 and times[-1] <= times[-2]:
            raise InputError.of(path, f"line {number}: the time {values[0]} s does not rise", AGAIN)
    if not rows:
        raise InputError.of(path, "the file holds no poses", AGAIN)
    numbers = np.array(rows)
    with about(path):
        camera_from_scan = rigid(Rotation.from_rotvec(numbers[:, 1:4]), numbers[:, 4:])
    return np.array(times, dtype=np.int64), camera_from_scan.inv()


def _read_frames(folder: Path, times: Ints, poses: RigidTransform) -> tuple[tuple[ScanFrame, ...], str]:
    """The frames of the best pictures that have poses, and a sentence about them."""
    assets = {p.name: _Asset.of(p) for p in sorted(folder.iterdir()) if p.is_dir()}
    for kind in (name for name in PICTURES if name in assets):
        pictures = assets[kind]
        rows = nearest_rows(pictures.timestamp_ns, times, POSE_TOLERANCE_NS)
        posed = np.flatnonzero(rows >= 0)
        if len(posed):
            frames = tuple(
                _read_frame(pictures.paths[i], int(pictures.timestamp_ns[i]), poses[int(rows[i])], kind, assets)
                for i in posed
            )
            return frames, f"{len(posed)} of the {len(rows)} pictures in {kind} have a pose at most 5 ms off."
    count = sum(len(assets[name].paths) for name in PICTURES if name in assets)
    looked_in = ", ".join(PICTURES)
    raise InputError.of(
        folder,
        f"none of the {count} pictures in {looked_in} is within 5 ms of one of the {len(times)} poses",
        "download pictures and trajectory of the same video",
    )


def _read_frame(picture: Path, time_ns: int, pose: RigidTransform, kind: str, assets: dict[str, _Asset]) -> ScanFrame:
    intrinsics = f"{kind}_intrinsics"
    pincam = assets[intrinsics].near(time_ns, INTRINSICS_TOLERANCE_NS) if intrinsics in assets else None
    if pincam is None:
        raise InputError.of(picture, f"{intrinsics} has no .pincam of this time", AGAIN)
    at_once = {name: asset.near(time_ns, POSE_TOLERANCE_NS) for name, asset in assets.items()}
    depth = at_once.get("lowres_depth")
    return ScanFrame(
        name=picture.stem,
        timestamp_ns=time_ns,
        camera=camera_at_size(_read_camera(pincam), size_of(picture), picture),
        scan_from_camera=pose,
        image_path=picture,
        depth_path=depth,
        confidence_path=None if depth is None else at_once.get("confidence"),
        own_files=tuple(path for path in at_once.values() if path is not None),
    )


def _read_camera(path: Path) -> Camera:
    values = read_text(path).split()
    try:
        width, height, fx, fy, cx, cy = (float(value) for value in values)
    except ValueError as error:
        problem = f"expected the six numbers width height fx fy cx cy, found {' '.join(values)[:60]!r}"
        raise InputError.of(path, problem, AGAIN) from error
    if not np.isfinite([width, height]).all():
        raise InputError.of(path, f"the size {width:g}x{height:g} is not finite", AGAIN)
    with about(path):
        matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
        return Camera.from_opencv(round(width), round(height), matrix, [])
