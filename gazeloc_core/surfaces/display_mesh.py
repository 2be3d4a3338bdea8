"""Meshes made fit to be looked at: fewer faces for the browser, soft shade for a scan without colours.

Picks, rays and measurements always use the scan's own mesh; these are only for the eye.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from gazeloc_core.arrays import Floats
from gazeloc_core.scan import Mesh, Texture

MAX_FACES = 500_000
"""Faces that a browser without a graphics card still draws once a second."""
_SHADE_DARK, _SHADE_BRIGHT = 96.0, 208.0
_LIGHT = np.array([0.42, 0.75, 0.51])


def display_mesh(mesh: Mesh, max_faces: int = MAX_FACES) -> Mesh:
    """The mesh with at most `max_faces` faces, shaded if it has no colours. Costs seconds at a million faces: cache it.

    Vertices are clustered in cubes whose size is the smallest, within 5 %, that gets below `max_faces`
    (Rossignac and Borrel 1993): position and colour are the cube's means, each face that survives keeps its texture.
    """
    return shaded(mesh if len(mesh.faces) <= max_faces else _clustered(mesh, max_faces))


def shaded(mesh: Mesh) -> Mesh:
    """The mesh, or where it has no colours, greys by the direction that each vertex faces, which give it form.

    The light shines from both sides, since the winding of a scan's faces cannot be trusted.
    """
    if mesh.has_colors:
        return mesh
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    face_normals = np.cross(b - a, c - a)
    normals = np.stack([_sum_at(mesh.faces, face_normals[:, i], len(mesh.vertices)) for i in range(3)], axis=1)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    grey = _SHADE_DARK + (_SHADE_BRIGHT - _SHADE_DARK) * np.abs(normals @ (_LIGHT / np.linalg.norm(_LIGHT)))
    return dataclasses.replace(mesh, colors=np.repeat(np.rint(grey)[:, None], 3, axis=1).astype(np.uint8))


def _sum_at(faces: NDArray[np.int32], values: Floats, count: int) -> Floats:
    return np.asarray(np.bincount(faces.ravel(), np.repeat(values, 3), count), dtype=np.float64)


def _clustered(mesh: Mesh, max_faces: int) -> Mesh:
    diagonal = float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))
    fine, coarse = diagonal * 1e-5, diagonal / 4
    while coarse > 1.05 * fine:
        middle = float(np.sqrt(fine * coarse))
        if _surviving_faces(mesh, _clusters(mesh.vertices, middle)).sum() > max_faces:
            fine = middle
        else:
            coarse = middle
    return _merged(mesh, _clusters(mesh.vertices, coarse))


def _clusters(vertices: Floats, cell_m: float) -> NDArray[np.int64]:
    """The number (V,) of the cube that each vertex is in."""
    cell = np.floor((vertices - vertices.min(axis=0)) / cell_m).astype(np.int64)
    size = cell.max(axis=0) + 1
    key = (cell[:, 0] * size[1] + cell[:, 1]) * size[2] + cell[:, 2]
    return np.asarray(np.unique(key, return_inverse=True)[1], dtype=np.int64)


def _surviving_faces(mesh: Mesh, cluster: NDArray[np.int64]) -> NDArray[np.bool_]:
    a, b, c = cluster[mesh.faces].T
    return np.asarray((a != b) & (b != c) & (c != a))


def _merged(mesh: Mesh, cluster: NDArray[np.int64]) -> Mesh:
    count = int(cluster.max()) + 1
    members = np.bincount(cluster, minlength=count)[:, None]

    def mean(values: Floats) -> Floats:
        sums = [np.bincount(cluster, column, count) for column in values.T]
        return np.stack(sums, axis=1) / members

    keep = _surviving_faces(mesh, cluster)
    texture = mesh.texture
    if texture is not None:
        texture = Texture(texture.images, texture.uv_of_corner[keep], texture.image_of_face[keep])
    colors = None if mesh.colors is None else np.rint(mean(mesh.colors.astype(np.float64))).astype(np.uint8)
    return Mesh(mean(mesh.vertices), cluster[mesh.faces[keep]].astype(np.int32), colors, texture)
