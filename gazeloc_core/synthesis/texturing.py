"""The scan's texture: each triangle coloured from one written frame, neighbours from the same one where that goes.

Triangles that share a frame form charts; a chart is a crop of that frame, so nothing is blurred by averaging, and seams
show only where the drifting poses disagree (the view selection of Waechter, Moehrle and Goesele, "Let there be color!",
ECCV 2014, with scores smoothed over the mesh instead of a Markov field).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components

from gazeloc_core.arrays import Bytes, Floats
from gazeloc_core.scan import Mesh
from gazeloc_core.synthesis.embree import hidden, ray_scene
from gazeloc_core.synthesis.packing import packed
from gazeloc_core.synthesis.phone import PhoneCapture

SMOOTHING_STEPS = 14
BORDER_PX = 4.0
CLEARANCE_M = 0.06
"""A hit this near to a face does not hide it: the mesh is noisy."""


@dataclass(frozen=True, eq=False)
class Textured:
    """A mesh with one picture: `uv` (K, 2) with v up, `uv_of_corner` (F, 3) into it."""

    vertices: Floats
    faces: NDArray[np.int32]
    uv: Floats
    uv_of_corner: NDArray[np.int64]
    image: Bytes


def textured(folder: Path, mesh: Mesh, capture: PhoneCapture, texel_m: float, atlas_width: int) -> Textured:
    """The mesh with a texture from the frames in `folder`; triangles that no frame saw are left out."""
    score, pixels = _scores(mesh, capture)
    seen = score.max(axis=1) > 0
    faces, score, pixels = mesh.faces[seen], score[seen], pixels[seen]
    links = _neighbours(faces)
    frame = _chosen(score, links)
    rows, columns = links.nonzero()
    same = frame[rows] == frame[columns]
    graph = coo_array((np.ones(same.sum()), (rows[same], columns[same])), shape=links.shape)
    _, chart = connected_components(graph, directed=False)
    corner_px = pixels[np.arange(len(faces)), frame]
    return _assembled(folder, mesh, faces, frame, chart, corner_px, texel_m, atlas_width)


def _scores(mesh: Mesh, capture: PhoneCapture) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """How well each frame shows each face (F, N), 0 for not at all, and the corners' pixels (F, N, 3, 2)."""
    scene = ray_scene(mesh.vertices, mesh.faces)
    corners = mesh.vertices[mesh.faces]
    center = corners.mean(axis=1)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-15)
    count = len(capture.cameras)
    score = np.zeros((len(center), count), dtype=np.float32)
    pixels = np.zeros((len(center), count, 3, 2), dtype=np.float32)
    for k, camera in enumerate(capture.cameras):
        pose = capture.written[k]
        in_camera = (mesh.vertices - pose.translation) @ pose.rotation.as_matrix()
        px = camera.project(in_camera)[mesh.faces]
        way = pose.translation - center
        distance = np.linalg.norm(way, axis=1)
        facing = (way * normal).sum(axis=1) / distance
        size = np.array([camera.width, camera.height])
        inside = ((px > BORDER_PX) & (px < size - BORDER_PX)).all(axis=(1, 2)) & (facing > 0.12)
        near = (CLEARANCE_M / distance[inside])[:, None]
        blocked = hidden(scene, center[inside] + near * way[inside], way[inside], far=0.98)
        off_axis = np.abs(px.mean(axis=1) / size - 0.5).max(axis=1)
        value = np.where(inside, facing / np.maximum(distance, 0.8) ** 1.5 * (1 - 0.6 * off_axis), 0)
        value[np.flatnonzero(inside)[blocked]] = 0
        score[:, k], pixels[:, k] = value, np.nan_to_num(px)
    return score, pixels


def _neighbours(faces: NDArray[np.int32]) -> csr_array:
    """Faces that share an edge, (F, F)."""
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    owner = np.repeat(np.arange(len(faces)), 3)
    order = np.lexsort((owner, edges[:, 1], edges[:, 0]))
    edges, owner = edges[order], owner[order]
    twin = np.flatnonzero((edges[1:] == edges[:-1]).all(axis=1))
    a, b = owner[twin], owner[twin + 1]
    shape = (len(faces), len(faces))
    return csr_array((np.ones(2 * len(a), np.float32), (np.r_[a, b], np.r_[b, a])), shape=shape)


def _chosen(score: NDArray[np.float32], links: csr_array) -> NDArray[np.int64]:
    """The frame of each face: best by scores that were smoothed over neighbours, among those that see it."""
    visible = score > 0
    smooth = score / score.max(axis=1, keepdims=True)
    degree = np.maximum(links.sum(axis=1), 1)[:, None]
    for _ in range(SMOOTHING_STEPS):
        smooth = 0.35 * smooth + 0.65 * (links @ smooth) / degree
    frame = np.where(visible, smooth, -1).argmax(axis=1)
    for _ in range(4):  # single triangles join their neighbours
        votes = np.zeros_like(smooth)
        rows, columns = links.nonzero()
        np.add.at(votes, (rows, frame[columns]), 1)
        frame = np.where(visible, votes + 0.5 * smooth, -1).argmax(axis=1)
    return np.asarray(frame, dtype=np.int64)


def _assembled(
    folder: Path,
    mesh: Mesh,
    faces: NDArray[np.int32],
    frame: NDArray[np.int64],
    chart: NDArray[np.int32],
    corner_px: NDArray[np.float32],
    texel_m: float,
    atlas_width: int,
) -> Textured:
    """Crops of the frames in one picture, and where each corner lies in it."""
    order = np.argsort(chart, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(chart[order])) + 1)
    low = np.array([np.floor(corner_px[g].min(axis=(0, 1))) - 2 for g in groups]).astype(int)
    high = np.array([np.ceil(corner_px[g].max(axis=(0, 1))) + 2 for g in groups]).astype(int)
    scale = np.array([_chart_scale(mesh.vertices[faces[g]], corner_px[g], texel_m) for g in groups])
    sizes = [(max(2, w), max(2, h)) for w, h in np.ceil((high - low) * scale[:, None]).astype(int).tolist()]
    places, height = packed(sizes, atlas_width, 1)
    atlas = np.full((height, atlas_width, 3), 128, dtype=np.uint8)
    xy = np.zeros((len(faces), 3, 2))
    images: dict[int, Bytes] = {}
    for g, a, b, (w, h), (x, y) in zip(groups, low, high, sizes, places, strict=True):
        k = int(frame[g[0]])
        if k not in images:
            images[k] = np.asarray(cv2.imread(str(folder / f"frame_{k:05d}.jpg")))
        factor = np.array([w, h]) / (b - a)
        xy[g] = (corner_px[g] - a) * factor
        crop = cv2.resize(images[k][a[1] : b[1], a[0] : b[0]], (w, h), interpolation=cv2.INTER_AREA)
        atlas[y - 1 : y + h + 1, x - 1 : x + w + 1] = cv2.copyMakeBorder(
            _filled(crop, xy[g]), 1, 1, 1, 1, cv2.BORDER_REPLICATE
        )
        xy[g] += (x, y)
    uv = np.round(np.stack([xy[..., 0] / atlas_width, 1 - xy[..., 1] / height], axis=-1), 5)
    unique, inverse = np.unique(uv.reshape(-1, 2), axis=0, return_inverse=True)
    used, renamed = np.unique(faces, return_inverse=True)
    vertices = np.asarray(mesh.vertices[used], dtype=np.float64)
    corners = np.asarray(renamed.reshape(-1, 3), dtype=np.int32)
    return Textured(vertices, corners, np.asarray(unique, dtype=np.float64), inverse.reshape(-1, 3), atlas)


def _chart_scale(corners: Floats, pixels: NDArray[np.float32], texel_m: float) -> float:
    """Atlas texels per frame pixel, so that a texel is about `texel_m` on the surface; never magnified."""
    length = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).sum()
    seen = np.linalg.norm(pixels - np.roll(pixels, 1, axis=1), axis=2).sum()
    return float(np.clip(length / texel_m / max(seen, 1e-6), 0.05, 1.0))


def _filled(crop: Bytes, triangles: Floats) -> Bytes:
    """The crop with its mean colour where no triangle of the chart lies, which packs better."""
    mask = np.zeros(crop.shape[:2], dtype=np.uint8)
    cv2.fillPoly(mask, list(np.rint(triangles).astype(np.int32)), 1)
    mask = cv2.dilate(mask, np.ones((7, 7), np.uint8))
    result = crop.copy()
    result[mask == 0] = crop[mask > 0].mean(axis=0)
    return result


def write_obj(folder: Path, mesh: Textured, quality: int) -> None:
    """`textured_output.obj`, `.mtl` and `.jpg`."""
    cv2.imwrite(str(folder / "textured_output.jpg"), mesh.image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    lines = ["# OBJ written by GazeLoc's scene generator", "mtllib textured_output.mtl", "usemtl material_0"]
    lines += [f"v {x:.3f} {y:.3f} {z:.3f}" for x, y, z in mesh.vertices.tolist()]
    lines += [f"vt {u:.5f} {v:.5f}" for u, v in mesh.uv.tolist()]
    for (a, b, c), (i, j, k) in zip((mesh.faces + 1).tolist(), (mesh.uv_of_corner + 1).tolist(), strict=True):
        lines.append(f"f {a}/{i} {b}/{j} {c}/{k}")
    (folder / "textured_output.obj").write_text("\n".join(lines) + "\n")
    (folder / "textured_output.mtl").write_text(
        "newmtl material_0\nKa 0.1 0.1 0.1\nKd 1.0 1.0 1.0\nKs 0.0 0.0 0.0\nillum 1\nmap_Kd textured_output.jpg\n"
    )
