"""Surfaces of a reconstruction from its sparse points alone, as the paper makes them to register a room (VI-A).

*Poisson* (Kazhdan and Hoppe, "Screened Poisson surface reconstruction", 2013): the smooth surface whose normals are
those of the points; it closes over gaps, so what lies far from every point is cut off again. *Delaunay*: the points'
tetrahedra, of which those that a line of sight from a camera to a point passes through are empty; the surface is where
empty ones end. That is the free-space half of Labatut, Pons and Keriven (2007) without their graph cut, and stands for
the sculpting that the paper cites (its [10]), which removes tetrahedra from outside and so never opens a room.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import Delaunay, QhullError, cKDTree

from gazeloc_core.arrays import Bools, Bytes, Floats, Ints
from gazeloc_core.errors import GeometryError
from gazeloc_core.scan import Mesh
from gazeloc_core.sfm_model import SfmModel

_SIGHTS_AT_ONCE = 1000
"""Lines of sight that are carved together; bounds the memory."""


@dataclass(frozen=True, kw_only=True)
class SurfacePointOptions:
    """Which points of a reconstruction surfaces are made of."""

    min_track_length: int = 3
    """Points seen in fewer images are left out."""
    max_error_px: float = 2.0
    """Points with a larger reprojection error are left out, in pixels."""
    neighbours: int = 16
    """A point's spacing is its mean distance to this many nearest neighbours."""
    max_spacing: float = 4.0
    """Points with more than this many times the median spacing are left out: they are alone, and mostly wrong."""
    least_points: int = 100
    """Fewer points than this make no surface."""


@dataclass(frozen=True, kw_only=True)
class PoissonOptions:
    """How Poisson's surface is made and cut."""

    points: SurfacePointOptions = SurfacePointOptions()
    """Which points take part."""
    depth: int = 8
    """The finest grid has 2^depth cells along each side."""
    cut_spacings: float = 2.0
    """What is further from every point than this many times the median spacing is cut off."""


@dataclass(frozen=True, kw_only=True)
class DelaunayOptions:
    """How the tetrahedra are carved."""

    points: SurfacePointOptions = SurfacePointOptions()
    """Which points take part."""
    max_sights: int = 20_000
    """No more lines of sight than this carve, chosen evenly."""
    steps: int = 200
    """A line of sight empties the tetrahedra at this many places along it."""
    stop_spacings: float = 0.25
    """It stops this many times the median spacing before its point, which is known no better."""
    max_edge_spacings: float = 4.0
    """Triangles with an edge longer than this many times the median spacing are dropped: they span gaps."""


@dataclass(frozen=True, eq=False)
class SightedPoints:
    """P points that a surface is made of: `points` (P, 3) in sfm, `colors` (P, 3), and who sees them.

    `sight_point` (L,) and `sight_from` (L, 3) are the L lines of sight: a row of `points` and a camera centre in sfm.
    `spacing` is the median of the points' mean distances to their neighbours, in sfm units.
    """

    points: Floats
    colors: Bytes
    sight_point: Ints
    sight_from: Floats
    spacing: float


def sighted_points(model: SfmModel, options: SurfacePointOptions | None = None) -> SightedPoints:
    """The model's well-measured points and the lines of sight to them.

    Raises:
        GeometryError: if too few are left.
    """
    options = options or SurfacePointOptions()
    seen = np.zeros(len(model.points), dtype=np.bool_)
    seen[model.observation_point] = True
    good = seen & (model.track_lengths >= options.min_track_length) & (model.point_errors_px <= options.max_error_px)
    spacing = _spacings(model.points[good], options.neighbours)
    rows = np.flatnonzero(good)[spacing <= options.max_spacing * np.median(spacing)] if len(spacing) else np.zeros(0)
    if len(rows) < options.least_points:
        raise GeometryError(
            f"Only {len(rows)} of the reconstruction's {len(model.points)} points are measured well enough for a "
            f"surface, which needs {options.least_points}; reconstruct from more or sharper frames."
        )
    row_of = np.full(len(model.points), -1)
    row_of[rows] = np.arange(len(rows))
    is_sight = row_of[model.observation_point] >= 0
    return SightedPoints(
        model.points[rows],
        model.point_colors[rows],
        row_of[model.observation_point[is_sight]],
        np.asarray(model.sfm_from_camera.translation)[model.observation_image[is_sight]],
        float(np.median(_spacings(model.points[rows], options.neighbours))),
    )


def poisson_surface(model: SfmModel, options: PoissonOptions | None = None) -> Mesh:
    """Poisson's surface of the model's points, in the frame `sfm`, with vertex colours.

    Normals come from neighbours and point to the cameras that see the point.

    Raises:
        GeometryError: if there are too few points.
    """
    import open3d as o3d

    options = options or PoissonOptions()
    seen = sighted_points(model, options.points)
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(seen.points))
    cloud.colors = o3d.utility.Vector3dVector(seen.colors / 255)
    cloud.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(options.points.neighbours))
    cloud.normals = o3d.utility.Vector3dVector(towards_cameras(seen, np.asarray(cloud.normals)))
    # With one thread the same points give the same surface to the last bit; more threads gain little.
    surface, _ = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(cloud, depth=options.depth, n_threads=1)
    vertices = np.asarray(surface.vertices, dtype=np.float64)
    far = cKDTree(seen.points).query(vertices)[0] > options.cut_spacings * seen.spacing
    surface.remove_vertices_by_mask(np.asarray(far).tolist())
    if len(surface.triangles) == 0:
        raise GeometryError(f"Poisson's surface of {len(seen.points)} points runs near none of them; try Delaunay.")
    return Mesh(
        np.asarray(surface.vertices, dtype=np.float64),
        np.asarray(surface.triangles, dtype=np.int32),
        np.rint(255 * np.clip(np.asarray(surface.vertex_colors), 0, 1)).astype(np.uint8),
    )


def towards_cameras(seen: SightedPoints, normals: Floats) -> Floats:
    """The normals (P, 3), each turned to the side from which most cameras see its point."""
    views = seen.sight_from - seen.points[seen.sight_point]
    views /= np.maximum(np.linalg.norm(views, axis=1, keepdims=True), 1e-30)
    facing = np.sum(views * normals[seen.sight_point], axis=1)
    side = np.bincount(seen.sight_point, facing, len(seen.points))
    return np.where(side[:, None] < 0, -normals, normals)


def delaunay_surface(model: SfmModel, options: DelaunayOptions | None = None) -> Mesh:
    """The carved Delaunay surface of the model's points, in the frame `sfm`, with vertex colours, facing the cameras.

    Raises:
        GeometryError: if there are too few points, they lie in one plane, or the cameras see no room before them.
    """
    options = options or DelaunayOptions()
    seen = sighted_points(model, options.points)
    try:
        tetrahedra = Delaunay(seen.points)
    except QhullError as error:
        raise GeometryError(
            f"The reconstruction's {len(seen.points)} points lie in one plane, which has no Delaunay surface; "
            "reconstruct from frames of the whole room."
        ) from error
    faces = _faces_of_empty(tetrahedra, _empty(tetrahedra, seen, options))
    corners = seen.points[faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1, initial=0)
    faces = faces[longest <= options.max_edge_spacings * seen.spacing]
    if len(faces) == 0:
        raise GeometryError(
            f"The lines of sight to {len(seen.points)} points leave no surface; check that the reconstruction's "
            "cameras stand in the room that its points show."
        )
    used, renumbered = np.unique(faces, return_inverse=True)
    return Mesh(seen.points[used], renumbered.reshape(-1, 3).astype(np.int32), seen.colors[used])


def _empty(tetrahedra: Delaunay, seen: SightedPoints, options: DelaunayOptions) -> Bools:
    """(T,) which tetrahedra lines of sight pass through, at places evenly along them."""
    chosen = np.arange(len(seen.sight_point))
    if len(chosen) > options.max_sights:
        chosen = np.random.default_rng(0).choice(chosen, options.max_sights, replace=False)
    there, here = seen.points[seen.sight_point[chosen]], seen.sight_from[chosen]
    length = np.linalg.norm(there - here, axis=1)
    end = np.maximum(1 - options.stop_spacings * seen.spacing / np.maximum(length, 1e-30), 0)
    is_empty = np.zeros(len(tetrahedra.simplices), dtype=np.bool_)
    shares = np.linspace(0, 1, options.steps)[:, None] * end
    for start in range(0, len(chosen), _SIGHTS_AT_ONCE):  # one line after the other: SciPy walks on from the last place
        some = slice(start, start + _SIGHTS_AT_ONCE)
        places = here[some, None] + shares.T[some, :, None] * (there - here)[some, None]
        inside = tetrahedra.find_simplex(places.reshape(-1, 3))
        is_empty[inside[inside >= 0]] = True
    return is_empty


def _faces_of_empty(tetrahedra: Delaunay, is_empty: Bools) -> Ints:
    """The triangles (F, 3) between empty tetrahedra and others (or nothing), wound to face the empty side."""
    opposite = tetrahedra.neighbors  # (T, 4): the neighbour across from each corner, -1 for none
    ends = is_empty[:, None] & ((opposite < 0) | ~is_empty[opposite])
    which, corner = np.nonzero(ends)
    others = np.array([[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]])[corner]
    faces = np.take_along_axis(tetrahedra.simplices[which], others, axis=1).astype(np.int64)
    a, b, c = (tetrahedra.points[faces[:, i]] for i in range(3))
    inner = tetrahedra.points[tetrahedra.simplices[which, corner]]
    faces_away = np.sum(np.cross(b - a, c - a) * (inner - a), axis=1) < 0
    faces[faces_away] = faces[faces_away][:, ::-1]
    return faces


def _spacings(points: Floats, neighbours: int) -> Floats:
    """(P,) the mean distance of each point to its nearest neighbours."""
    if len(points) < 2:
        return np.zeros(len(points))
    ranks = np.arange(2, min(neighbours + 1, len(points)) + 1)  # the first is the point itself
    return np.asarray(np.mean(cKDTree(points).query(points, k=ranks)[0], axis=1), dtype=np.float64)
