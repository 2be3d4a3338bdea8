"""Iterative closest point: sparse points of the reconstruction against the scan's mesh, from a given alignment.

Two variants, as sources differ on which is better. Point to point is the paper's (Besl and McKay, "A method for
registration of 3-D shapes", PAMI 1992). Point to plane (Chen and Medioni, "Object modelling by registration of multiple
range images", IVC 1992) lets points slide along surfaces, which sparse points on bare walls need. Both meet the mesh
itself (nearest place on a triangle) instead of samples of it, weigh far points down by Tukey's function, and shrink the
distance at which a point takes part. A point whose nearest place is the rim of the mesh takes no part (Turk and Levoy,
"Zippered polygon meshes", SIGGRAPH 1994): the scan ends there and what the point lies on was not scanned.

Whether the result may replace its start is not decided here but in refine.py: ICP's own overlap and residual improve
even while it ruins an alignment.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from gazeloc_core.alignment.alignment import AlignmentMethod
from gazeloc_core.alignment.similarity_fit import similarity_jacobian, solve_umeyama
from gazeloc_core.arrays import Bools, Floats
from gazeloc_core.errors import GeometryError
from gazeloc_core.progress import Report, silent
from gazeloc_core.sfm_model import SfmModel
from gazeloc_core.surfaces.raycast import Hits, Raycaster
from gazeloc_core.transforms import Similarity


@dataclass(frozen=True, kw_only=True)
class IcpOptions:
    """Which points take part, and how near to the mesh they must be."""

    schedule_m: tuple[float, ...] = (0.30, 0.15, 0.08, 0.05)
    """Distances to the mesh within which points take part, one after the other, in metres."""
    iterations: int = 25
    """Most iterations at each of these distances."""
    stop_m: float = 0.00005
    """A distance is done when no point moves further than this in an iteration, in metres."""
    with_scale: bool = False
    """Let ICP change the scale too; off, as sparse points on few walls determine it badly."""
    min_track_length: int = 3
    """Points seen in fewer images are left out."""
    max_error_px: float = 2.0
    """Points with a larger reprojection error are left out, in pixels."""
    voxel_m: float = 0.03
    """Points are thinned to one per cube of this size, so that textured spots do not outweigh bare walls, in metres."""
    max_points: int = 6000
    """No more points than this take part, chosen evenly."""
    min_points: int = 50
    """Fewer points near the mesh than this are no base for ICP."""


@dataclass(frozen=True)
class Overlap:
    """ICP's own view of an alignment, reported and never decisive: the share of points within `within_m` of the mesh,
    and the root mean square distance of those, in metres."""

    share: float
    rms_m: float
    within_m: float


class Target:
    """The scan's mesh as what points are drawn to: nearest places, except on the rim of the mesh."""

    def __init__(self, raycaster: Raycaster):
        self.raycaster = raycaster
        mesh = raycaster.mesh
        # Vertices are split where a texture has a seam: edges are joined by place, not by index.
        _, place = np.unique(np.round(mesh.vertices, 6), axis=0, return_inverse=True)
        corners = place.reshape(-1)[mesh.faces].astype(np.int64)
        edges = np.sort(np.stack([corners[:, [1, 2]], corners[:, [2, 0]], corners[:, [0, 1]]], axis=1), axis=2)
        _, which, uses = np.unique(edges.reshape(-1, 2), axis=0, return_inverse=True, return_counts=True)
        self._is_rim = (uses[which.reshape(-1)] == 1).reshape(-1, 3)
        on_rim = np.zeros(int(corners.max()) + 1, dtype=np.bool_)
        on_rim[edges[self._is_rim].ravel()] = True
        self._is_rim_corner = on_rim[corners]

    def nearest(self, points: Floats) -> tuple[Hits, Bools]:
        """The nearest places of points (N, 3), and whether each is inside the surface, not on its rim."""
        hits = self.raycaster.closest(points)
        weights = np.column_stack([1 - hits.barycentric.sum(axis=1), hits.barycentric])
        is_zero = weights < 1e-4  # a corner without weight: the place is on the edge opposite to it
        on_edge = (is_zero & self._is_rim[hits.face]).any(axis=1)
        on_corner = ((weights > 1 - 2e-4) & self._is_rim_corner[hits.face]).any(axis=1)
        return hits, ~(on_edge | on_corner)


def choose_points(model: SfmModel, scan_from_sfm: Similarity, target: Target, options: IcpOptions) -> Floats:
    """The model's points (N, 3) in sfm that are well measured, near the mesh, and spread evenly.

    Raises:
        GeometryError: if too few are left.
    """
    good = (model.track_lengths >= options.min_track_length) & (model.point_errors_px <= options.max_error_px)
    points = model.points[good]
    in_scan = scan_from_sfm.apply(points)
    _, first = np.unique(np.floor(in_scan / options.voxel_m).astype(np.int64), axis=0, return_index=True)
    points, in_scan = points[first], in_scan[first]
    near = np.zeros(len(points), dtype=np.bool_)
    if len(points):
        hits, is_inside = target.nearest(in_scan)
        near = is_inside & (hits.distance <= options.schedule_m[0])
    if near.sum() < options.min_points:
        raise GeometryError(
            f"Only {int(near.sum())} of the reconstruction's {len(model.points)} points lie within "
            f"{options.schedule_m[0]:.2f} m of the scan, ICP needs {options.min_points}; check the alignment it starts "
            "from, and that scan and recording show the same room."
        )
    kept = np.flatnonzero(near)
    if len(kept) > options.max_points:
        kept = np.random.default_rng(0).choice(kept, options.max_points, replace=False)
    return np.asarray(points[kept], dtype=np.float64)


def overlap(points_in_scan: Floats, target: Target, within_m: float) -> Overlap:
    """How points (N, 3) lie on the mesh."""
    distance = target.raycaster.closest(points_in_scan).distance
    near = distance[distance <= within_m]
    rms = float(np.sqrt(np.mean(near**2))) if len(near) else float("inf")
    return Overlap(len(near) / max(len(distance), 1), rms, within_m)


def run_icp(
    start: Similarity,
    points_in_sfm: Floats,
    target: Target,
    method: AlignmentMethod,
    options: IcpOptions,
    report: Report = silent,
) -> Similarity:
    """`scan_from_sfm` after ICP of points (N, 3) from `start`; `report` is called at every iteration."""
    current = start
    for stage, within in enumerate(options.schedule_m):
        for iteration in range(options.iterations):
            report((stage + iteration / options.iterations) / len(options.schedule_m), f"{method.value}, {within} m")
            step = _step(current.apply(points_in_sfm), target, within, method, options)
            if step is None:
                break
            delta, largest_move = step
            current = delta * current
            if largest_move < options.stop_m:
                break
    report(1.0, method.value)
    return current


def _step(
    points: Floats, target: Target, within_m: float, method: AlignmentMethod, options: IcpOptions
) -> tuple[Similarity, float] | None:
    """The next small motion in the scan, and how far it moves a point at most; None if too few points are near."""
    hits, is_inside = target.nearest(points)
    near = is_inside & (hits.distance < within_m)
    if near.sum() < options.min_points:
        return None
    here, there = points[near], target.raycaster.points(hits)[near]
    if method is AlignmentMethod.ICP_POINT_TO_PLANE:
        normals = target.raycaster.normals(hits)[near]
        delta = _towards_planes(here, there, normals, within_m, options.with_scale)
    else:
        delta = _towards_points(here, there, within_m, options.with_scale)
    return delta, float(np.linalg.norm(delta.apply(here) - here, axis=1).max())


def _tukey(distance: Floats, within_m: float) -> Floats:
    """Tukey's biweight: 1 at no distance, 0 from `within_m` on, the same on both sides of a surface."""
    return np.asarray((1 - np.minimum(np.abs(distance) / within_m, 1) ** 2) ** 2, dtype=np.float64)


def _towards_points(here: Floats, there: Floats, within_m: float, with_scale: bool) -> Similarity:
    weights = _tukey(np.linalg.norm(here - there, axis=1), within_m) + 1e-12
    scale, rotation, translation = solve_umeyama(here, there, weights)
    if not with_scale:
        mean_here, mean_there = (np.average(points, axis=0, weights=weights) for points in (here, there))
        return Similarity(1.0, Rotation.from_matrix(rotation), mean_there - rotation @ mean_here)
    return Similarity(float(scale), Rotation.from_matrix(rotation), translation)


def _towards_planes(here: Floats, there: Floats, normals: Floats, within_m: float, with_scale: bool) -> Similarity:
    offset = np.einsum("ni,ni->n", there - here, normals)
    weights = _tukey(offset, within_m)
    centre = here.mean(axis=0)
    rows = np.einsum("ni,nia->na", normals, similarity_jacobian(here, centre))[:, : 7 if with_scale else 6]
    normal_matrix, right = rows.T @ (rows * weights[:, None]), rows.T @ (weights * offset)
    # Directions that no surface holds (along a corridor) stay where they are.
    motion = np.linalg.pinv(normal_matrix, rcond=1e-5, hermitian=True) @ right
    rotation = Rotation.from_rotvec(motion[:3])
    scale = 1 + motion[6] if with_scale else 1.0
    return Similarity(float(scale), rotation, centre + motion[3:6] - scale * rotation.as_matrix() @ centre)
