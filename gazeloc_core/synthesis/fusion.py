"""The scan's mesh: the written depth fused at the written (drifting) poses, so noisy and holed like a real one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import open3d as o3d
from numpy.typing import NDArray

from gazeloc_core.camera import HALF_PIXEL
from gazeloc_core.scan import Mesh
from gazeloc_core.synthesis.embree import tensor
from gazeloc_core.synthesis.phone import PhoneCapture

DEPTH_MAX_M = 5.0
MIN_SPECK_M2 = 0.04
"""Connected pieces of surface that are smaller than this are dropped."""


def fused(folder: Path, capture: PhoneCapture, voxel_m: float, faces: int) -> Mesh:
    """The decimated zero level of a truncated signed distance field (Curless and Levoy 1996) over confident depth.

    Surfaces must have been seen by two frames, in captures that are long enough to see most of them twice.
    """
    channels: Any = (1, 1)
    grid = o3d.t.geometry.VoxelBlockGrid(
        attr_names=("tsdf", "weight"),
        attr_dtypes=(o3d.core.float32, o3d.core.float32),
        attr_channels=channels,
        voxel_size=voxel_m,
        block_resolution=16,
        block_count=20000,
    )
    for index, camera in enumerate(capture.cameras):
        depth = np.asarray(cv2.imread(str(folder / f"depth_{index:05d}.png"), cv2.IMREAD_UNCHANGED))
        confidence = np.asarray(cv2.imread(str(folder / f"conf_{index:05d}.png"), cv2.IMREAD_UNCHANGED))
        depth[confidence < 2] = 0
        image = o3d.t.geometry.Image(tensor(depth))
        matrix = camera.scaled(depth.shape[1], depth.shape[0]).matrix
        matrix[:2, 2] -= HALF_PIXEL  # Open3D counts from the first pixel's centre
        intrinsic = tensor(matrix)
        camera_from_scan = tensor(capture.written[index].inv().as_matrix())
        blocks = grid.compute_unique_block_coordinates(image, intrinsic, camera_from_scan, 1000.0, DEPTH_MAX_M)
        grid.integrate(blocks, image, intrinsic, camera_from_scan, 1000.0, DEPTH_MAX_M)
    raw = grid.extract_triangle_mesh(1.5 if len(capture.cameras) >= 24 else 0.5)
    speck = int(2 * MIN_SPECK_M2 / voxel_m**2)
    return _decimated(raw.vertex.positions.numpy(), raw.triangle.indices.numpy(), faces, speck)


def _decimated(vertices: NDArray[Any], triangles: NDArray[Any], faces: int, speck_faces: int) -> Mesh:
    """Fewer triangles, without specks; in an order that does not depend on threads."""
    order = np.lexsort(vertices.T)
    place = np.empty(len(order), dtype=np.int64)
    place[order] = np.arange(len(order))
    triangles = place[triangles]
    first = triangles.argmin(axis=1)
    triangles = triangles[np.arange(len(triangles))[:, None], (first[:, None] + np.arange(3)) % 3]
    triangles = triangles[np.lexsort(triangles.T[::-1])]
    mesh = o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(vertices[order].astype(np.float64)), o3d.utility.Vector3iVector(triangles)
    )
    mesh.remove_duplicated_vertices()
    mesh.remove_degenerate_triangles()
    label, size, _ = mesh.cluster_connected_triangles()
    small = np.asarray(size)[np.asarray(label)] < speck_faces
    mesh.remove_triangles_by_mask(small)
    mesh.remove_unreferenced_vertices()
    mesh = mesh.simplify_quadric_decimation(faces)
    mesh.remove_degenerate_triangles()
    mesh.remove_unreferenced_vertices()
    return Mesh(np.asarray(mesh.vertices), np.asarray(mesh.triangles).astype(np.int32))
