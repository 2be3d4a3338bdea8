"""How good the poses of single tags are (the paper, section V): with pictures alone, and where camera poses are known.

With pictures alone the paper asks whether the estimated distance grows in proportion to the tag size that the solver is
told, D = alpha · L (figure 3), and whether the slope agrees with the one that the pinhole drawing (figure 4) gives:

        O camera    Q, P   centre and corner of the tag in the picture, on the plane z = 1 (the focal length)
        ·           B, A   the same in space, by the estimated pose
    Q ──┼─ P        A'     where the ray of A meets the plane through B that is parallel to the picture
       ·│           Δd     O to Q      ΔD   O to B, the distance
    B ──┼── A'
         ╲          PQ / A'B = Δd / ΔD  (1)    Δd² = f² + Δuv²  (2)    alpha = (Δd / PQ) · (A'B / L)  (3)
          A

Pixels become rays by the camera first, so that f = 1, and fx ≠ fy and lens distortion are no matter. Q and P are those
of the detector, B and A those of the solver: their alphas differ by what the pose does not explain of the corners. That
is no measure of the true error: whatever looks like another distance changes both alike.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import RigidTransform, Rotation

from gazeloc_core.arrays import Floats, Ints, frozen
from gazeloc_core.camera import Camera
from gazeloc_core.errors import InputError
from gazeloc_core.tag_types import TagCorners, TagSightings
from gazeloc_core.tags.pose import TagPoses, apriltag_poses, normalised_corners
from gazeloc_core.tags.square import UNIT_SQUARE, rotation_of_square, tag_centre_px

Solver = Callable[[ArrayLike, Camera | Sequence[Camera], ArrayLike], TagPoses]
"""Corners (S, 4, 2), cameras, sizes in metres to poses: `tag_poses` or `apriltag_poses`."""

_SQUARE = np.column_stack([UNIT_SQUARE, np.zeros(4)])


@dataclass(frozen=True, kw_only=True)
class AnalysisOptions:
    """Which tag sizes the solver is told, and which solver it is."""

    least_scale: float = 0.5
    """The smallest assumed size, as a share of the true one."""
    most_scale: float = 2.0
    """The largest assumed size, as a share of the true one."""
    steps: int = 7
    """How many sizes are assumed."""
    solver: Solver = apriltag_poses
    """The pose solver; by default the AprilTag library's own, which is the paper's."""


@dataclass(frozen=True, eq=False)
class SolverAnalysis:
    """The paper's figures 3 and 5 for S sightings; NaN where the solver has no answer.

    `frame_index` (S,), `tag_id` (S,). Figure 3: `size_m` (K,) the assumed sizes, `distance_of_size_m` (S, K) what the
    solver makes of them, and the line through these: `alpha_estimated` (S,) its slope, `intercept_m` (S,),
    `line_residual_m` (S,) the furthest point from it. Figure 5: `alpha_of_corner` (S, 4) by equation (3), `alpha_true`
    (S,) their mean, `distance_error_m` (S,) |alpha_estimated - alpha_true| · L, `distance_m` (S,) at the true size, and
    the viewing angles of `viewing_angles_deg`: `euler_deg` (S, 3), `oblique_deg` (S,).
    """

    frame_index: Ints
    tag_id: Ints
    size_m: Floats
    distance_of_size_m: Floats
    alpha_estimated: Floats
    intercept_m: Floats
    line_residual_m: Floats
    alpha_of_corner: Floats
    alpha_true: Floats
    distance_error_m: Floats
    distance_m: Floats
    euler_deg: Floats
    oblique_deg: Floats

    def __post_init__(self) -> None:
        for name in vars(self):
            object.__setattr__(self, name, frozen(getattr(self, name), getattr(self, name).dtype))


@dataclass(frozen=True, eq=False)
class PlaceErrors:
    """Where sightings put their tags on the scan against where they are (section V, third paragraph).

    `frame_index` (S,), `tag_id` (S,), `centre_in_scan` (S, 3) as estimated, `distance_m` (S,) from the camera to the
    tag's place, `error_m` (S,) between the two centres, `range_error_m` (S,) its part along the line of sight
    (positive: estimated too far), `rotation_error_deg` (S,). NaN where the tag has no place or the solver no answer.
    """

    frame_index: Ints
    tag_id: Ints
    centre_in_scan: Floats
    distance_m: Floats
    error_m: Floats
    range_error_m: Floats
    rotation_error_deg: Floats

    def __post_init__(self) -> None:
        for name in vars(self):
            object.__setattr__(self, name, frozen(getattr(self, name), getattr(self, name).dtype))


def analyse_solver(
    sightings: TagSightings,
    cameras: Camera | Sequence[Camera],
    tag_size_m: float,
    options: AnalysisOptions | None = None,
) -> SolverAnalysis:
    """Figures 3 and 5 for the sightings of any tags of the true size `tag_size_m`, with one camera or one for each.

    Raises:
        InputError: if the size is impossible, the assumed sizes do not make a line, or cameras are missing.
    """
    options = options or AnalysisOptions()
    if not 0 < options.least_scale < options.most_scale or options.steps < 2:
        raise InputError(
            f"Sizes from {options.least_scale} to {options.most_scale} times the true one in {options.steps} steps "
            "make no line; choose rising positive shares and two steps or more."
        )
    corners = sightings.corners_px
    sizes = tag_size_m * np.linspace(options.least_scale, options.most_scale, options.steps)
    poses = options.solver(corners, cameras, tag_size_m)
    distances = np.stack([_distances(options.solver(corners, cameras, size)) for size in sizes], axis=1)
    slope, intercept, residual = _lines(sizes, distances)
    of_corner = alpha_of_corners(normalised_corners(corners, cameras), poses, tag_size_m)
    alpha = of_corner.mean(axis=1)
    euler, oblique = viewing_angles_deg(poses.rotation[:, 0], poses.translation[:, 0])
    return SolverAnalysis(
        frame_index=sightings.frame_index,
        tag_id=sightings.tag_id,
        size_m=sizes,
        distance_of_size_m=distances,
        alpha_estimated=slope,
        intercept_m=intercept,
        line_residual_m=residual,
        alpha_of_corner=of_corner,
        alpha_true=alpha,
        distance_error_m=np.abs(slope - alpha) * tag_size_m,
        distance_m=_distances(poses),
        euler_deg=euler,
        oblique_deg=oblique,
    )


def alpha_of_corners(seen: Floats, poses: TagPoses, tag_size_m: float) -> Floats:
    """Equation (3) for each corner (S, 4), of normalised corners (S, 4, 2) and each sighting's first pose."""
    q = np.array([tag_centre_px(corners) for corners in seen]).reshape(-1, 1, 2)
    b = poses.translation[:, None, 0]
    a = np.einsum("sij,cj->sci", poses.rotation[:, 0], _SQUARE * tag_size_m) + b
    a_on_plane = a * (b[..., 2:] / a[..., 2:])
    delta_d = np.sqrt(1 + np.sum(q**2, axis=2))
    pq = np.linalg.norm(seen - q, axis=2)
    return np.asarray(delta_d / pq * np.linalg.norm(a_on_plane - b, axis=2) / tag_size_m)


def viewing_angles_deg(rotation: Floats, translation: Floats) -> tuple[Floats, Floats]:
    """How tags (S,) are turned against the camera, of their poses `camera_from_tag` (S, 3, 3) and (S, 3).

    First (S, 3): Euler angles about the camera's x, then y, then z axis, R = Rz Ry Rx; all zero for a tag that hangs
    upright, parallel to the picture. Second (S,): the angle between the tag's normal and the line of sight to its
    centre, 0 for a tag that is looked at straight. NaN for NaN.
    """
    known = np.isfinite(rotation).all(axis=(1, 2))
    euler, oblique = np.full((len(rotation), 3), np.nan), np.full(len(rotation), np.nan)
    if known.any():
        euler[known] = Rotation.from_matrix(rotation[known]).as_euler("xyz", degrees=True)
        sight = translation[known] / np.linalg.norm(translation[known], axis=1, keepdims=True)
        cosine = np.sum(rotation[known, :, 2] * sight, axis=1)
        oblique[known] = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    return euler, oblique


def tag_place_errors(
    sightings: TagSightings,
    cameras: Camera | Sequence[Camera],
    scan_from_camera: RigidTransform,
    places: TagCorners,
    tag_size_m: float,
    solver: Solver = apriltag_poses,
) -> PlaceErrors:
    """Each sighting's tag by `scan_from_camera * camera_from_tag`, poses (S,), against `places` in the frame `scan`.

    Raises:
        InputError: if the size is impossible, or there is another number of cameras or poses than sightings.
    """
    count = len(sightings)
    if count != len(np.atleast_2d(scan_from_camera.translation)):
        raise InputError(f"There are {count} tag sightings but other poses; give scan_from_camera for each.")
    poses = solver(sightings.corners_px, cameras, tag_size_m)
    turn, at = scan_from_camera.rotation.as_matrix().reshape(-1, 3, 3), scan_from_camera.translation.reshape(-1, 3)
    centres = np.einsum("sij,sj->si", turn, poses.translation[:, 0]) + at
    row_of = {int(tag_id): row for row, tag_id in enumerate(places.tag_id)}
    true, square = np.full((count, 3), np.nan), np.full((count, 3, 3), np.nan)
    for i, tag_id in enumerate(sightings.tag_id.tolist()):
        if tag_id in row_of:
            true[i] = places.centers[row_of[tag_id]]
            square[i] = rotation_of_square(places.corners[row_of[tag_id]])
    distance = np.linalg.norm(true - at, axis=1)
    return PlaceErrors(
        frame_index=sightings.frame_index,
        tag_id=sightings.tag_id,
        centre_in_scan=centres,
        distance_m=distance,
        error_m=np.linalg.norm(centres - true, axis=1),
        range_error_m=_distances(poses) - distance,
        rotation_error_deg=_angles_deg(np.einsum("sij,sjk->sik", turn, poses.rotation[:, 0]), square),
    )


def _distances(poses: TagPoses) -> Floats:
    return np.asarray(np.linalg.norm(poses.translation[:, 0], axis=1))


def _lines(x: Floats, y: Floats) -> tuple[Floats, Floats, Floats]:
    """Slope, intercept and largest residual (S,) of the least-squares lines through (x (K,), y (S, K))."""
    middle = x.mean()
    slope = (y @ (x - middle)) / np.sum((x - middle) ** 2)
    intercept = y.mean(axis=1) - slope * middle
    residual = np.abs(y - slope[:, None] * x - intercept[:, None]).max(axis=1, initial=0.0)
    return slope, intercept, residual


def _angles_deg(first: Floats, second: Floats) -> Floats:
    """The angles (S,) between rotations (S, 3, 3); NaN for NaN."""
    known = np.isfinite(first).all(axis=(1, 2)) & np.isfinite(second).all(axis=(1, 2))
    angles = np.full(len(first), np.nan)
    if known.any():
        between = Rotation.from_matrix(np.swapaxes(first[known], 1, 2) @ second[known])
        angles[known] = np.degrees(between.magnitude())
    return angles
