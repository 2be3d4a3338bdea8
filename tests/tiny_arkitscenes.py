"""An ARKitScenes video of the furnished room in `app_project`, a few pictures long, valid until a test damages it.

Written by OpenCV and plain matrices from the true poses, as Apple's files have it: nothing here is the reader's.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
import trimesh
from app_project import room_mesh, true_poses

from gazeloc_core.arrays import Bytes, Floats
from gazeloc_core.camera import Camera
from gazeloc_core.surfaces.raycast import Raycaster
from gazeloc_core.surfaces.render import RayRenderer

VIDEO = "40777060"
START_S, STEP_S = 305.377, 0.1
LOWRES, WIDE = (256, 192), (480, 360)


def matrix(size: tuple[int, int], frame: int) -> Floats:
    """A camera matrix with the first pixel's centre at (0, 0), for a picture of this size; it breathes with focus."""
    focal = (0.82 + 0.004 * frame) * size[0]
    return np.array([[focal, 0, 0.497 * size[0]], [0, focal, 0.511 * size[1]], [0, 0, 1]])


def camera_from_scan(frame: int, count: int) -> tuple[Floats, Floats]:
    """World to camera as axis-angle (3,) and translation (3,)."""
    pose = true_poses(count)[frame].as_matrix()
    inverse = np.linalg.inv(pose)
    return cv2.Rodrigues(inverse[:3, :3])[0].ravel(), inverse[:3, 3]


def write_arkitscenes(folder: Path, *, frames: int = 4, raw: bool = False, wide: bool = False) -> Path:
    """`folder` as `<split>/<video>` of the 3DOD or the raw set; between posed pictures lies one without a pose."""
    inside = folder if raw else folder / f"{VIDEO}_frames"
    kinds = {"lowres_wide": LOWRES, **({"wide": WIDE} if wide else {})}
    names = ("lowres_depth", "confidence", *kinds, *(f"{kind}_intrinsics" for kind in kinds))
    for name in names:
        (inside / name).mkdir(parents=True)
    (folder / f"{VIDEO}_3dod_mesh.ply").write_bytes(_mesh_file())
    lines = []
    for i in range(frames):
        rotation, translation = camera_from_scan(i, frames)
        seconds = START_S + STEP_S * i
        numbers = " ".join(f"{value:.9f}" for value in (*rotation, *translation))
        lines.append(f"{seconds + 0.0004 * (i % 3):.6f} {numbers}")
        for kind, size in kinds.items():
            _write(inside / kind / f"{VIDEO}_{seconds:.3f}.png", _picture(i, frames, size))
            _write(inside / kind / f"{VIDEO}_{seconds + 0.05:.3f}.png", np.zeros((size[1], size[0], 3), np.uint8))
            (fx, _, cx), (_, fy, cy), _ = matrix(size, i)
            name = f"{VIDEO}_{seconds + 0.001 * (i % 3 - 1):.3f}.pincam"
            (inside / f"{kind}_intrinsics" / name).write_text(f"{size[0]} {size[1]} {fx} {fy} {cx} {cy}\n")
        depth, sure = _depth_mm(i, frames)
        _write(inside / "lowres_depth" / f"{VIDEO}_{seconds:.3f}.png", depth)
        _write(inside / "confidence" / f"{VIDEO}_{seconds:.3f}.png", sure)
    (inside / "lowres_wide.traj").write_text("\n".join(lines) + "\n")
    return folder


def _write(path: Path, picture: np.ndarray) -> None:
    assert cv2.imwrite(str(path), picture)


@lru_cache(maxsize=1)
def _raycaster() -> Raycaster:
    return Raycaster(room_mesh())


@lru_cache(maxsize=1)
def _mesh_file() -> bytes:
    mesh = room_mesh()
    colored = trimesh.Trimesh(mesh.vertices, mesh.faces, vertex_colors=mesh.colors, process=False)
    return bytes(colored.export(file_type="ply"))


@lru_cache(maxsize=64)
def _picture(frame: int, count: int, size: tuple[int, int]) -> Bytes:
    raycaster = _raycaster()
    camera = Camera.from_opencv(*size, matrix(size, frame), [])
    rgb = RayRenderer(raycaster.mesh, raycaster=raycaster).render(camera, true_poses(count)[frame]).rgb
    return cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR)


@lru_cache(maxsize=64)
def _depth_mm(frame: int, count: int) -> tuple[np.ndarray, Bytes]:
    """Depth along the camera's axis, by plain pinhole rays; of low confidence, and wrong, along the left border."""
    k, (width, height) = matrix(LOWRES, frame), LOWRES
    u, v = np.meshgrid(np.arange(width), np.arange(height))
    rays = np.stack([(u - k[0, 2]) / k[0, 0], (v - k[1, 2]) / k[1, 1], np.ones_like(u)], axis=-1).reshape(-1, 3)
    pose = true_poses(count)[frame].as_matrix()
    distance = _raycaster().cast(pose[:3, 3], rays @ pose[:3, :3].T).distance.reshape(height, width)
    depth = (distance * 1000).round().astype(np.uint16)
    sure = np.full((height, width), 2, np.uint8)
    sure[:, :20], depth[:, :20] = 1, 9000
    return depth, sure
