"""Point clouds in Open3D: sampled surfaces, features, and the two registrations that need no tag.

Open3D holds Python's GIL while it works and takes seconds to import, so that is left to the first caller. The same
seed gives the same answer to the last bit, whatever the number of threads.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from gazeloc_core.arrays import Floats
from gazeloc_core.errors import GeometryError
from gazeloc_core.scan import Mesh
from gazeloc_core.transforms import Similarity

NORMAL_NEIGHBOURS = 30
FEATURE_NEIGHBOURS = 100
"""Most neighbours within the radius that a normal and a feature are made of, as in Open3D's own examples."""
LEAST_SCALE = 0.01
"""Clouds of about one size that are registered with a smaller scale than this have collapsed, not been registered."""


@dataclass(frozen=True)
class Registered:
    """A registration's answer: `a_from_b`, the share of b's points that have a partner in a (`fitness`), and the root
    mean square distance of these (`rms`), in units of a."""

    a_from_b: Similarity
    fitness: float
    rms: float


def sample_surface(mesh: Mesh, count: int, seed: int) -> Floats:
    """Points (count, 3) spread evenly over a mesh's area, in the mesh's frame."""
    import open3d as o3d

    # Open3D refuses read-only arrays, so they are copied here and below.
    vertices, faces = o3d.utility.Vector3dVector(mesh.vertices.copy()), o3d.utility.Vector3iVector(mesh.faces.copy())
    surface = o3d.geometry.TriangleMesh(vertices, faces)
    if surface.get_surface_area() <= 0:
        raise GeometryError(f"The surface of {len(mesh.faces)} triangles has no area to sample points on.")
    o3d.utility.random.seed(seed)
    return np.asarray(surface.sample_points_uniformly(count).points, dtype=np.float64)


def ransac_of_features(
    points_in_b: Floats, points_in_a: Floats, *, voxel: float, with_scale: bool, iterations: int, seed: int
) -> Registered | None:
    """`a_from_b` that the most FPFH matches of two thinned clouds (N, 3), (M, 3) agree on; None where none do.

    Both clouds must have about one size: `voxel` is in the units of both, and the radii follow from it as in Open3D's
    example: 2 voxels for normals, 5 for features, 1.5 for what agrees. Features: Rusu et al., "Fast Point Feature
    Histograms (FPFH) for 3D registration", ICRA 2009; RANSAC: Fischler and Bolles 1981.
    """
    import open3d as o3d

    registration = o3d.pipelines.registration
    (b, features_b), (a, features_a) = (_described(points, voxel) for points in (points_in_b, points_in_a))
    if min(len(a.points), len(b.points)) < 4:
        return None
    within = 1.5 * voxel
    o3d.utility.random.seed(seed)
    answer = registration.registration_ransac_based_on_feature_matching(
        b,
        a,
        features_b,
        features_a,
        mutual_filter=False,
        max_correspondence_distance=within,
        estimation_method=registration.TransformationEstimationPointToPoint(with_scale),
        ransac_n=3,
        checkers=[
            registration.CorrespondenceCheckerBasedOnEdgeLength(0.9),
            registration.CorrespondenceCheckerBasedOnDistance(within),
        ],
        criteria=registration.RANSACConvergenceCriteria(iterations, 0.999),
    )
    return _registered(answer)


def icp_point_to_point(
    points_in_b: Floats,
    points_in_a: Floats,
    start: Similarity,
    *,
    within: float,
    with_scale: bool = False,
    iterations: int = 100,
) -> Registered | None:
    """`a_from_b` after ICP of points (N, 3) against points (M, 3) no further than `within` (in a) from `start`.

    Without `with_scale` the scale of `start` stays. None where no point has a partner. (Besl and McKay, PAMI 1992.)
    """
    import open3d as o3d

    registration = o3d.pipelines.registration
    answer = registration.registration_icp(
        _cloud(start.apply(points_in_b)),
        _cloud(points_in_a),
        within,
        np.eye(4),
        registration.TransformationEstimationPointToPoint(with_scale),
        registration.ICPConvergenceCriteria(1e-9, 1e-9, iterations),
    )
    found = _registered(answer)
    return None if found is None else Registered(found.a_from_b * start, found.fitness, found.rms)


def _cloud(points: Floats) -> Any:
    import open3d as o3d

    return o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.array(points, dtype=np.float64)))


def _described(points: Floats, voxel: float) -> tuple[Any, Any]:
    """The thinned cloud with its normals, and its features."""
    import open3d as o3d

    near = o3d.geometry.KDTreeSearchParamHybrid
    cloud = _cloud(points).voxel_down_sample(voxel)
    cloud.estimate_normals(near(2 * voxel, NORMAL_NEIGHBOURS))
    compute: Any = o3d.pipelines.registration.compute_fpfh_feature  # its stub demands an argument that it does not need
    return cloud, compute(cloud, near(5 * voxel, FEATURE_NEIGHBOURS))


def _registered(answer: Any) -> Registered | None:
    if answer.fitness <= 0:
        return None
    matrix = np.asarray(answer.transformation, dtype=np.float64)
    if np.cbrt(np.linalg.det(matrix[:3, :3])) < LEAST_SCALE:
        return None  # with a free scale all points may be drawn onto one of the other cloud, which "fits"
    return Registered(Similarity.from_matrix(matrix, "registration"), float(answer.fitness), float(answer.inlier_rmse))
