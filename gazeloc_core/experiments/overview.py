"""Still pictures of a room from above one corner, with cameras, paths and points drawn into it (figures 11 to 14)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from gazeloc_core.arrays import Bools, Bytes, Floats
from gazeloc_core.camera import Camera
from gazeloc_core.scan import Mesh, RoomScan
from gazeloc_core.surfaces.display_mesh import shaded
from gazeloc_core.surfaces.glb import Rgb
from gazeloc_core.surfaces.raycast import Raycaster
from gazeloc_core.surfaces.render import RayRenderer
from gazeloc_core.surfaces.viewpoint import facing, overview, up_vector

SIZE_PX = (960, 720)
PAPER: Rgb = (255, 255, 255)
_SHIFT = 4
"""OpenCV draws at 1 / 2^4 of a pixel."""


@dataclass(frozen=True, eq=False)
class View:
    """A picture (H, W, 3) and the camera at `scan_from_camera` that took it."""

    rgb: Bytes
    camera: Camera
    scan_from_camera: RigidTransform

    def pixels(self, points_in_scan: Floats) -> Floats:
        """Where points (N, 3) are in the picture (N, 2), NaN behind the camera."""
        rotation = self.scan_from_camera.rotation.as_matrix()
        return self.camera.project((points_in_scan - self.scan_from_camera.translation) @ rotation)


def look_into(mesh: Mesh, scan: RoomScan) -> View:
    """The room from above a corner, without the walls and the ceiling that would be in the way."""
    eye, target = overview(mesh, scan.up_axis)
    pose = look_at(eye, target, up_vector(scan.up_axis))
    camera = _filled_by(mesh, pose)
    places = [np.asarray(frame.scan_from_camera.translation) for frame in scan.frames] or [mesh.bounds.mean(axis=0)]
    turned, is_clear = facing(shaded(mesh), places)
    renderer = RayRenderer(turned, raycaster=Raycaster(_without(turned, _is_away(turned, eye)) if is_clear else turned))
    picture = renderer.render(camera, pose)
    rgb = picture.rgb.copy()
    if picture.depth_m is not None:
        rgb[~np.isfinite(picture.depth_m)] = PAPER
    return View(rgb, camera, pose)


def _filled_by(mesh: Mesh, pose: RigidTransform, margin: float = 0.96) -> Camera:
    """A camera at this pose whose picture the mesh just fills."""
    width, height = SIZE_PX
    in_camera = (mesh.vertices - pose.translation) @ pose.rotation.as_matrix()
    x, y = (in_camera[:, :2] / in_camera[:, 2:]).T
    (left, right), (top, bottom) = (np.percentile(values, [0.5, 99.5]) for values in (x, y))
    focal = margin * min(width / (right - left), height / (bottom - top))
    middle = (width / 2 - focal * (left + right) / 2, height / 2 - focal * (top + bottom) / 2)
    return Camera.pinhole(width, height, focal, focal, *middle)


def look_at(eye: Floats, target: Floats, up: Floats) -> RigidTransform:
    """The pose `scan_from_camera` of a camera at `eye` (3,) that has `target` in its middle."""
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    matrix = np.column_stack([right, np.cross(forward, right), forward])
    return RigidTransform.from_components(eye, Rotation.from_matrix(matrix))


def with_cameras(view: View, poses: RigidTransform, color: Rgb, depth_m: float = 0.12) -> View:
    """With cameras drawn as little pyramids, and their centres joined in the order given."""
    rgb = view.rgb.copy()
    half = 0.6 * depth_m
    base = np.array([[-half, -half, depth_m], [half, -half, depth_m], [half, half, depth_m], [-half, half, depth_m]])
    for pose in poses:
        corners = base @ pose.rotation.as_matrix().T + pose.translation
        lines = [np.array([pose.translation, corner]) for corner in corners] + [corners[[0, 1, 2, 3, 0]]]
        for line in lines:
            _polyline(rgb, view.pixels(line), color, 1)
    return replace(view, rgb=rgb)


def with_path(view: View, centers: Floats, color: Rgb) -> View:
    """With a line through points (N, 3), interrupted at rows of NaN."""
    rgb = view.rgb.copy()
    _polyline(rgb, view.pixels(centers), color, 2)
    return replace(view, rgb=rgb)


def with_points(view: View, points: Floats, colors: Bytes | Rgb, radius_px: int = 1) -> View:
    """With points (N, 3) as dots, all in one colour or each in its own (N, 3)."""
    rgb = view.rgb.copy()
    pixels = view.pixels(points)
    each = np.broadcast_to(np.asarray(colors, dtype=np.uint8), (len(points), 3))
    for (x, y), color in zip(pixels, each.tolist(), strict=True):
        if np.isfinite(x) and -1e4 < x < 1e4 and -1e4 < y < 1e4:
            cv2.circle(rgb, (int(x), int(y)), radius_px, color, -1, cv2.LINE_AA)
    return replace(view, rgb=rgb)


def side_by_side(pictures: Sequence[Bytes], labels: Sequence[str], columns: int) -> Bytes:
    """Pictures of one size in a grid, each with its label."""
    rows = []
    labelled = [_labelled(picture, label) for picture, label in zip(pictures, labels, strict=True)]
    blank = np.full_like(labelled[0], 255)
    for start in range(0, len(labelled), columns):
        row = labelled[start : start + columns]
        rows.append(np.hstack([*row, *[blank] * (columns - len(row))]))
    return np.vstack(rows)


def _labelled(rgb: Bytes, label: str) -> Bytes:
    framed = cv2.copyMakeBorder(rgb, 26, 4, 4, 4, cv2.BORDER_CONSTANT, value=PAPER)
    cv2.putText(framed, label, (6, 18), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (30, 30, 30), 1, cv2.LINE_AA)
    return np.asarray(framed, dtype=np.uint8)


def _polyline(rgb: Bytes, pixels: Floats, color: Rgb, width: int) -> None:
    ok = np.asarray((np.abs(np.nan_to_num(pixels, nan=np.inf)) < 1e4).all(axis=1), dtype=np.bool_)
    runs = np.split(np.arange(len(pixels)), np.flatnonzero(np.diff(ok.astype(int))) + 1)
    for run in (run for run in runs if len(run) > 1 and ok[run[0]]):
        fixed = np.round((pixels[run] - 0.5) * 2**_SHIFT).astype(np.int32)
        cv2.polylines(rgb, [fixed], False, color, width, cv2.LINE_AA, _SHIFT)


def _is_away(mesh: Mesh, eye: Floats) -> Bools:
    """(F,) which faces show their back to the eye."""
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    return np.asarray(np.einsum("ij,ij->i", np.cross(b - a, c - a), eye - a) <= 0, dtype=np.bool_)


def _without(mesh: Mesh, drop: Bools) -> Mesh:
    texture = mesh.texture
    if texture is not None:
        texture = replace(texture, uv_of_corner=texture.uv_of_corner[~drop], image_of_face=texture.image_of_face[~drop])
    return replace(mesh, faces=mesh.faces[~drop], texture=texture)
