"""Rays against the scan's mesh (Open3D with Embree). The only home of ray casting.

Open3D holds Python's GIL while it builds the tree and casts: callers in a server do this in a process of their own.
It takes seconds to import, so that is left to the first caster: most commands need none.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gazeloc_core.arrays import Bools, Bytes, Floats
from gazeloc_core.scan import Mesh

NO_FACE = -1


@dataclass(frozen=True, eq=False)
class Hits:
    """Where N rays met the mesh: `distance` (N,) in units of the ray's direction, inf for a miss.

    `face` (N,) is the triangle, -1 for a miss; `barycentric` (N, 2) the weights of its second and third corner.
    """

    distance: Floats
    face: NDArray[np.int64]
    barycentric: Floats

    @property
    def is_hit(self) -> Bools:
        """(N,) whether the ray met the mesh."""
        return np.asarray(self.face != NO_FACE)


class Raycaster:
    """Casts rays against one mesh; building it costs about 0.6 s per million triangles."""

    def __init__(self, mesh: Mesh, faces_per_tree: int | None = None):
        """With `faces_per_tree` the mesh is split over several trees, each built by the first cast.

        Python's GIL is then free again after each: 50,000 faces hold it for 50 ms, a million in one tree for a second.
        A ray costs about 0.03 ms per tree, so that split ones are for single rays.
        """
        self.mesh = mesh
        size = faces_per_tree or len(mesh.faces)
        self._trees = [_Tree(mesh, first, size) for first in range(0, len(mesh.faces), size)]

    def cast(self, origins: ArrayLike, directions: ArrayLike) -> Hits:
        """The first hit of each ray; `origins` and `directions` (N, 3) in the frame `scan`."""
        o = np.asarray(origins, dtype=np.float32).reshape(-1, 3)
        d = np.asarray(directions, dtype=np.float32).reshape(-1, 3)
        rays = np.concatenate([np.broadcast_to(o, d.shape), d], axis=1)
        rays = np.where(np.isfinite(rays).all(axis=1, keepdims=True), rays, np.float32(0))
        tensor = _tensor(np.ascontiguousarray(rays))
        return _nearest([tree.cast(tensor) for tree in self._trees])

    def closest(self, points: ArrayLike) -> Hits:
        """The place on the mesh nearest to each point (N, 3) in the frame `scan`; `distance` is in metres."""
        p = np.ascontiguousarray(np.asarray(points, dtype=np.float32).reshape(-1, 3))
        return _nearest([tree.closest(p) for tree in self._trees])

    def points(self, hits: Hits) -> Floats:
        """The hit points (N, 3) in the frame `scan`, on the triangles in double precision; NaN for a miss."""
        points = np.full((len(hits.face), 3), np.nan)
        ok = hits.is_hit
        a, b, c = (self.mesh.vertices[self.mesh.faces[hits.face[ok], i]] for i in range(3))
        u, v = hits.barycentric[ok].T[:, :, None]
        points[ok] = (1 - u - v) * a + u * b + v * c
        return points

    def normals(self, hits: Hits) -> Floats:
        """Unit normals (N, 3) of the triangles hit, by their winding; NaN for a miss."""
        normals = np.full((len(hits.face), 3), np.nan)
        ok = hits.is_hit
        a, b, c = (self.mesh.vertices[self.mesh.faces[hits.face[ok], i]] for i in range(3))
        n = np.cross(b - a, c - a)
        normals[ok] = n / np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-30)
        return normals

    def colors(self, hits: Hits, background: tuple[int, int, int] = (32, 32, 36)) -> Bytes:
        """sRGB colours (N, 3) at the hits, from the texture or the vertices, as in the scan file.

        Grey where the mesh has neither; `background` for a miss.
        """
        colors = np.empty((len(hits.face), 3), dtype=np.uint8)
        colors[:] = background
        ok = hits.is_hit
        face = hits.face[ok]
        weights = np.column_stack([1 - hits.barycentric[ok].sum(axis=1), hits.barycentric[ok]])
        mesh = self.mesh
        if mesh.texture is not None:
            found = np.full((len(face), 3), 128, dtype=np.uint8)
            uv = np.einsum("nk,nkd->nd", weights, mesh.texture.uv_of_corner[face])
            for index, image in enumerate(mesh.texture.images):
                here = mesh.texture.image_of_face[face] == index
                height, width = image.shape[:2]
                x = np.clip((uv[here, 0] % 1.0) * width, 0, width - 1).astype(np.int64)
                y = np.clip((1 - uv[here, 1] % 1.0) * height, 0, height - 1).astype(np.int64)
                found[here] = image[y, x]
            colors[ok] = found
        elif mesh.colors is not None:
            corner = mesh.colors[mesh.faces[face]].astype(np.float64)
            colors[ok] = np.rint(np.einsum("nk,nkd->nd", weights, corner)).astype(np.uint8)
        else:
            colors[ok] = 160
        return colors


class _Tree:
    """The faces from `first` on, `size` at most."""

    def __init__(self, mesh: Mesh, first: int, size: int):
        import open3d as o3d

        self._first = first
        faces: NDArray[Any] = mesh.faces[first : first + size]
        vertices = mesh.vertices
        if len(faces) < len(mesh.faces):
            used, corner = np.unique(faces.ravel(), return_inverse=True)
            faces, vertices = corner.reshape(-1, 3), vertices[used]
        self._scene = o3d.t.geometry.RaycastingScene()
        self._scene.add_triangles(_tensor(vertices.astype(np.float32)), _tensor(faces.astype(np.uint32)))

    def cast(self, rays: Any) -> Hits:
        """The first hit of each ray, a tensor (N, 6)."""
        answer = self._scene.cast_rays(rays)
        faces = answer["primitive_ids"].numpy().astype(np.int64)
        faces = np.where(faces == self._scene.INVALID_ID, NO_FACE, faces + self._first)
        distance, uv = answer["t_hit"].numpy(), answer["primitive_uvs"].numpy()
        return Hits(distance.astype(np.float64), faces, uv.astype(np.float64))

    def closest(self, points: NDArray[np.float32]) -> Hits:
        """The nearest place to each point (N, 3)."""
        answer = self._scene.compute_closest_points(_tensor(points))
        distance = np.linalg.norm(answer["points"].numpy().astype(np.float64) - points, axis=1)
        faces = answer["primitive_ids"].numpy().astype(np.int64) + self._first
        return Hits(distance, faces, answer["primitive_uvs"].numpy().astype(np.float64))


def _nearest(of_trees: list[Hits]) -> Hits:
    """Of every tree's hits of the same N rays or points the nearest."""
    if len(of_trees) == 1:
        return of_trees[0]
    distances = np.stack([hits.distance for hits in of_trees])
    tree, row = distances.argmin(axis=0), np.arange(distances.shape[1])
    faces = np.stack([hits.face for hits in of_trees])
    return Hits(distances[tree, row], faces[tree, row], np.stack([hits.barycentric for hits in of_trees])[tree, row])


def _tensor(array: Any) -> Any:  # Open3D's own stubs refuse every NumPy array
    import open3d as o3d

    return cast(Any, o3d.core.Tensor)(array)
