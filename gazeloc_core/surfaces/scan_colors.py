"""Colours for a mesh that has none, taken from the posed frames of its own scan.

Each point of the surface takes the weighted mean of the frames that see it. Frames that look straight at it, from
near and without blur, count most; the weights are sharpened by a power, so that slightly wrong poses blur little.
Meshes with triangles larger than a texel get a texture in which every triangle has its own half of a small square;
finer meshes get colours per vertex.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from gazeloc_core.arrays import Bytes, Floats
from gazeloc_core.progress import Report
from gazeloc_core.scan import Mesh, RoomScan, ScanFrame, Texture
from gazeloc_core.surfaces.raycast import Raycaster

Singles: TypeAlias = NDArray[np.float32]

UNSEEN = (122, 132, 148)
"""Grey-blue, for what no frame sees."""

TEXEL_M = 0.008
MOST_TEXELS = 1_600_000
SMALLEST_SQUARE, LARGEST_SQUARE = 6, 40
MARGIN = 1
"""Texels by which a triangle stays off the border of its square, so that neighbours do not bleed in."""

MOST_FRAMES = 120
PICTURE_WIDTH = 960
DEPTH_WIDTH = 320
NEAREST_M = 0.1
VISIBLE_WITHIN_M = 0.02
VISIBLE_WITHIN_SHARE = 0.01
BEHIND_LIDAR_M = 0.05
WEIGHT_POWER = 10
SMALLEST_WEIGHT = 1e-30
"""Above what single precision rounds to 0, which would count as unseen."""
USUAL_SHARPNESS = 0.05


@dataclass(frozen=True, eq=False)
class _View:
    """A frame prepared for colouring: its small picture, and how deep it sees in metres, by the mesh and by lidar.

    Lidar also sees what the mesh lacks, which would otherwise be painted on what lies behind it.
    """

    frame: ScanFrame
    picture: Bytes
    depth_limit: Singles
    sharpness: float


def color_from_frames(scan: RoomScan, report: Report) -> tuple[Mesh, str]:
    """The scan's mesh, same vertices and faces, coloured from its frames with pictures; and a sentence about it.

    Raises:
        InputError: if a picture is missing or does not decode.
    """
    mesh = scan.mesh
    side = _square_side(mesh)
    if side is None:
        points, normals = mesh.vertices, _vertex_normals(mesh)
    else:
        points, normals = _texels(mesh, side)
    frames = scan.frames_with_images
    frames = tuple(frames[i] for i in np.unique(np.linspace(0, len(frames) - 1, MOST_FRAMES).astype(int)))
    colors, is_seen = _colors_of_points(points, normals, mesh, frames, report)
    what = "vertices" if side is None else "texels"
    note = (
        f"The mesh has no colours: it was coloured from {len(frames)} posed frames; {1 - is_seen.mean():.0%} of its "
        f"{len(points)} {what} are seen by none and grey-blue."
    )
    if side is None:
        return Mesh(mesh.vertices, mesh.faces, colors), note
    return Mesh(mesh.vertices, mesh.faces, None, _atlas(len(mesh.faces), side, colors)), note


def _square_side(mesh: Mesh) -> int | None:
    """Texels along the square that two triangles share, or None where vertices are fine enough or texels too many."""
    corners = mesh.vertices[mesh.faces]
    edge_m = float(np.median(np.linalg.norm(corners[:, 0] - corners[:, 1], axis=1)))
    affordable = int(np.sqrt(2 * MOST_TEXELS / len(mesh.faces)))
    side = min(int(np.ceil(edge_m / TEXEL_M)) + 2 * MARGIN + 1, affordable, LARGEST_SQUARE)
    if edge_m <= TEXEL_M or affordable < SMALLEST_SQUARE:
        return None
    return max(side, SMALLEST_SQUARE)


def _squares_per_row(face_count: int) -> int:
    return int(np.ceil(np.sqrt((face_count + 1) // 2)))


def _corner_places(side: int) -> Floats:
    """Where the corners of a square's lower and upper triangle lie in it, in texels, (2, 3, 2)."""
    near, far = MARGIN, side - MARGIN
    lower = [(near, near), (far - 1, near), (near, far - 1)]
    upper = [(far, far), (near + 1, far), (far, near + 1)]
    return np.array([lower, upper], dtype=np.float64)


def _texels(mesh: Mesh, side: int) -> tuple[Floats, Floats]:
    """Points on the surface and normals for all texels of all squares, (squares * side * side, 3), row by row in each.

    Texels beside a triangle take its nearest barycentric coordinates, so that filtering at its border finds its colour.
    """
    squares = _squares_per_row(len(mesh.faces)) ** 2
    y, x = np.mgrid[:side, :side] + 0.5
    is_upper = (x + y > side).ravel()
    places = _corner_places(side)[is_upper.astype(int)]  # (S, 3, 2)
    offset = np.column_stack([x.ravel(), y.ravel()]) - places[:, 0]
    reach = side - 2 * MARGIN - 1
    towards = np.column_stack([offset[:, 0], offset[:, 1]]) / reach * np.where(is_upper, -1, 1)[:, None]
    towards = np.clip(towards, 0, 1)
    towards /= np.maximum(towards.sum(axis=1, keepdims=True), 1)
    weights = np.column_stack([1 - towards.sum(axis=1), towards])  # (S, 3)
    face = np.minimum(2 * np.arange(squares)[:, None] + is_upper, len(mesh.faces) - 1)  # (squares, S)
    corners = mesh.vertices[mesh.faces]
    points = np.einsum("sk,nskd->nsd", weights, corners[face])
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return points.reshape(-1, 3), normals[face].reshape(-1, 3)


def _atlas(face_count: int, side: int, colors: Bytes) -> Texture:
    """The texture whose texels are those of `_texels`."""
    row = _squares_per_row(face_count)
    image = colors.reshape(row, row, side, side, 3).transpose(0, 2, 1, 3, 4).reshape(row * side, row * side, 3)
    face = np.arange(face_count)
    square = face // 2
    start = np.column_stack([square % row, square // row]) * side
    texel = start[:, None] + _corner_places(side)[face % 2]  # the upper triangle's second corner lies to the left
    uv = texel / (row * side)
    uv[..., 1] = 1 - uv[..., 1]
    return Texture((np.ascontiguousarray(image),), uv.astype(np.float32), np.zeros(face_count, dtype=np.int32))


def _vertex_normals(mesh: Mesh) -> Floats:
    corners = mesh.vertices[mesh.faces]
    of_face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros_like(mesh.vertices)
    for i in range(3):
        np.add.at(normals, mesh.faces[:, i], of_face)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return normals


def _colors_of_points(
    points: Floats, normals: Floats, mesh: Mesh, frames: tuple[ScanFrame, ...], report: Report
) -> tuple[Bytes, NDArray[np.bool_]]:
    caster = Raycaster(mesh)
    places, directions = points.astype(np.float32), normals.astype(np.float32)
    total = np.zeros((len(points), 3), dtype=np.float32)
    weight = np.zeros(len(points), dtype=np.float32)
    for number, frame in enumerate(frames):
        report(number / len(frames), f"colouring the mesh from frame {number + 1} of {len(frames)}")
        view = _view(frame, caster)
        index, w, seen = _seen_by(view, places, directions)
        total[index] += w[:, None] * seen
        weight[index] += w
    is_seen = weight > 0
    colors = np.empty((len(points), 3), dtype=np.uint8)
    colors[:] = UNSEEN
    colors[is_seen] = np.rint(total[is_seen] / weight[is_seen, None]).clip(0, 255).astype(np.uint8)
    return colors, is_seen


def _view(frame: ScanFrame, caster: Raycaster) -> _View:
    image = frame.read_image()
    camera = frame.camera
    size = (min(PICTURE_WIDTH, camera.width), max(1, round(camera.height * min(1, PICTURE_WIDTH / camera.width))))
    picture = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    small = camera.scaled(
        min(DEPTH_WIDTH, camera.width), max(1, round(camera.height * min(1, DEPTH_WIDTH / camera.width)))
    )
    rays = small.unproject(small.pixel_centres())
    rays = rays / rays[:, 2:]
    hits = caster.cast(frame.scan_from_camera.translation, rays @ frame.scan_from_camera.rotation.as_matrix().T)
    depth = hits.distance.reshape(small.height, small.width).astype(np.float32)
    limit = depth * (1 + VISIBLE_WITHIN_SHARE) + VISIBLE_WITHIN_M
    if frame.depth_path is not None:
        lidar = np.nan_to_num(frame.read_depth_m(), nan=np.inf).astype(np.float32)
        lidar = np.asarray(cv2.resize(lidar, (small.width, small.height), interpolation=cv2.INTER_NEAREST))
        limit = np.minimum(limit, lidar * (1 + 2 * VISIBLE_WITHIN_SHARE) + BEHIND_LIDAR_M)
    nearest = np.asarray(cv2.erode(limit, np.ones((3, 3), np.uint8)), dtype=np.float32)
    laplacian = cv2.Laplacian(cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY), cv2.CV_32F)
    return _View(frame, picture, nearest, (float(np.asarray(laplacian).std()) / 255 + 1e-3) / USUAL_SHARPNESS)


def _seen_by(view: _View, points: Singles, normals: Singles) -> tuple[NDArray[np.int64], Singles, Bytes]:
    """Indices of the points that a frame sees, their weights and colours."""
    camera = view.frame.camera
    camera_from_scan = view.frame.scan_from_camera.inv().as_matrix().astype(np.float32)
    x, y, z = (points @ row[:3] + row[3] for row in camera_from_scan[:3])
    w, h = camera.width, camera.height
    corners = camera.unproject([(0, 0), (w, 0), (0, h), (w, h)])
    wide, high = (float(v) for v in 1.01 * np.abs(corners[:, :2] / corners[:, 2:]).max(axis=0))
    index = np.flatnonzero((z > NEAREST_M) & (np.abs(x) < wide * z) & (np.abs(y) < high * z))
    in_camera = np.column_stack([x[index], y[index], z[index]])
    share = (camera.project(in_camera) / (w, h)).astype(np.float32)
    u, v = share.T
    inside = (u >= 0) & (u < 1) & (v >= 0) & (v < 1)
    index, in_camera, share = index[inside], in_camera[inside], share[inside]
    is_visible = in_camera[:, 2] <= _at(view.depth_limit, share)
    index, in_camera, share = index[is_visible], in_camera[is_visible], share[is_visible]
    distance = np.linalg.norm(in_camera, axis=1)
    facing = np.abs(np.einsum("nd,nd->n", in_camera, normals[index] @ camera_from_scan[:3, :3].T)) / distance
    weight = (np.maximum(facing, 0.05) * view.sharpness / np.maximum(distance, NEAREST_M)) ** WEIGHT_POWER
    weight = np.maximum(weight, SMALLEST_WEIGHT)
    return index.astype(np.int64), weight.astype(np.float32), _at(view.picture, share)


def _at(image: NDArray[Any], share: Singles) -> NDArray[Any]:
    """The values of an image at places given as shares of its width and height, (N, 2), each below 1."""
    rows, columns = image.shape[:2]
    return np.asarray(image[(share[:, 1] * rows).astype(np.int64), (share[:, 0] * columns).astype(np.int64)])
