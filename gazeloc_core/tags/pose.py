"""Where a tag is in a camera that sees its four corners: both answers, since a square has two that look alike.

A small square turned a little to the left looks almost as one turned a little to the right (Schweighofer and Pinz,
"Robust pose estimation from a planar target", PAMI 2006). Which of the two is right shows in the perspective of its
edges, which for a small, far or frontal tag is below the noise of its corners; then the two errors are nearly equal.

`tag_poses` gives both, in closed form (IPPE: Collins and Bartoli, "Infinitesimal plane-based pose estimation", IJCV
2014). `apriltag_poses` gives what the AprilTag library's own solver gives: orthogonal iteration (Lu, Hager and
Mjolsness, PAMI 2000) from both of them, and of the two minima the one with the lower error in space. It is written here
because the library offers its solver for the pictures that it searches only.

Corners are turned into rays by the camera first, so that half a pixel and lens distortion are no matter here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import RigidTransform

from gazeloc_core.arrays import Floats, frozen
from gazeloc_core.camera import Camera
from gazeloc_core.errors import InputError
from gazeloc_core.tags.square import UNIT_SQUARE
from gazeloc_core.transforms import rigid, rotation_from_matrix

LARGEST_TAG_M = 10.0
_SQUARE = np.column_stack([UNIT_SQUARE, np.zeros(4)])
_ROUNDS = 50  # as many as the AprilTag library does


@dataclass(frozen=True, eq=False)
class TagPoses:
    """Both poses `camera_from_tag` of S sighted tags, the one with the lower reprojection error first.

    `rotation` (S, 2, 3, 3); `translation` (S, 2, 3) in metres; `rms_px` (S, 2) over the four corners. A sighting that
    has one answer only (its corners are no picture of a square) has NaN for the second, or for both.
    """

    rotation: Floats
    translation: Floats
    rms_px: Floats

    def __post_init__(self) -> None:
        for name in ("rotation", "translation", "rms_px"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    def __len__(self) -> int:
        return len(self.rms_px)

    @property
    def ratio(self) -> Floats:
        """(S,) the lower error over the higher one: near 1 the picture does not tell the two poses apart."""
        return np.asarray(self.rms_px[:, 0] / np.maximum(self.rms_px[:, 1], 1e-12))

    def camera_from_tag(self, index: int, which: int = 0) -> RigidTransform:
        """One of the poses.

        Raises:
            GeometryError: if the sighting has no such answer.
        """
        what = "the tag's pose"
        rotation = rotation_from_matrix(self.rotation[index, which], what)
        return rigid(rotation, self.translation[index, which], what)


def checked_tag_size(tag_size_m: float) -> float:
    """The size of a tag in metres, if it can be one.

    Raises:
        InputError: if it is not a number above 0 and below 10 m.
    """
    if not 0 < tag_size_m < LARGEST_TAG_M:
        raise InputError(f"The tag size is {tag_size_m} m; give the side between the detected corners in metres.")
    return float(tag_size_m)


def tag_poses(corners_px: ArrayLike, cameras: Camera | Sequence[Camera], sizes_m: ArrayLike) -> TagPoses:
    """Both poses of tags of size (S,) or one for all, from their corners (S, 4, 2) in the order of `tag_types.py`.

    `cameras` is one for all or one per sighting. Source: IPPE, in OpenCV's implementation for squares, in rays.

    Raises:
        InputError: if a size is impossible or there is another number of cameras.
    """
    corners = np.asarray(corners_px, dtype=np.float64).reshape(-1, 4, 2)
    count = len(corners)
    sizes = np.array([checked_tag_size(float(size)) for size in np.broadcast_to(np.asarray(sizes_m, float), count)])
    seen = normalised_corners(corners, cameras)
    rotation, translation = np.full((count, 2, 3, 3), np.nan), np.full((count, 2, 3), np.nan)
    for i in range(count):
        for k, (r, t) in enumerate(_planar_answers(seen[i], sizes[i])):
            rotation[i, k], translation[i, k] = r, t
    return _ordered(corners, cameras, sizes, rotation, translation)


def apriltag_poses(corners_px: ArrayLike, cameras: Camera | Sequence[Camera], sizes_m: ArrayLike) -> TagPoses:
    """The poses of `tag_poses` after orthogonal iteration, the one with the lower error in space first.

    The first is what the AprilTag library's `estimate_tag_pose` returns (it too follows both minima and takes the lower
    one); `rms_px` stays the error in the picture, so that it need not rise from first to second.
    """
    corners = np.asarray(corners_px, dtype=np.float64).reshape(-1, 4, 2)
    start = tag_poses(corners, cameras, sizes_m)
    good = np.isfinite(start.rms_px).ravel()
    sizes = np.repeat(np.broadcast_to(np.asarray(sizes_m, float), len(corners)), 2)[good]
    rays = np.concatenate([normalised_corners(corners, cameras), np.ones((len(corners), 4, 1))], axis=2)
    rotation, translation = start.rotation.reshape(-1, 3, 3).copy(), start.translation.reshape(-1, 3).copy()
    error = np.full(len(good), np.inf)
    rotation[good], translation[good], error[good] = _orthogonal_iteration(
        rotation[good], _SQUARE * sizes[:, None, None], rays.repeat(2, axis=0)[good]
    )
    return _ordered(corners, cameras, sizes_m, rotation, translation, error)


def _ordered(
    corners: Floats,
    cameras: Camera | Sequence[Camera],
    sizes_m: ArrayLike,
    rotation: Floats,
    translation: Floats,
    error: Floats | None = None,
) -> TagPoses:
    """Rotations (2 S, 3, 3) and translations (2 S, 3) as `TagPoses`, by rising `error` (2 S,), else by that in px."""
    count = len(corners)
    sizes = np.broadcast_to(np.asarray(sizes_m, float), count)
    pairs = rotation.reshape(count, 2, 3, 3), translation.reshape(count, 2, 3)
    places = np.einsum("skij,scj->skci", pairs[0], _SQUARE * sizes[:, None, None]) + pairs[1][:, :, None]
    rms = np.full((count, 2), np.nan)
    for camera, mine in _by_camera(_one_per_sighting(cameras, count)):
        off = camera.project(places[mine]).reshape(-1, 2, 4, 2) - corners[mine, None]
        rms[mine] = np.sqrt(np.mean(np.sum(off**2, axis=3), axis=2))
    rows = np.arange(count)[:, None]
    order = np.argsort(rms if error is None else error.reshape(count, 2), axis=1, kind="stable")  # NaN last
    return TagPoses(pairs[0][rows, order], pairs[1][rows, order], rms[rows, order])


def normalised_corners(corners_px: Floats, cameras: Camera | Sequence[Camera]) -> Floats:
    """The rays' x/z and y/z (S, 4, 2) through corners (S, 4, 2) of `cameras`, one for all or one per sighting."""
    normalised = np.empty((len(corners_px), 4, 2))
    for camera, mine in _by_camera(_one_per_sighting(cameras, len(corners_px))):
        rays = camera.unproject(corners_px[mine].reshape(-1, 2))
        normalised[mine] = (rays[:, :2] / rays[:, 2:]).reshape(-1, 4, 2)
    return normalised


def _one_per_sighting(cameras: Camera | Sequence[Camera], count: int) -> list[Camera]:
    each = [cameras] * count if isinstance(cameras, Camera) else list(cameras)
    if len(each) != count:
        raise InputError(f"There are {count} tag sightings but {len(each)} cameras; give one for each.")
    return each


def _by_camera(cameras: list[Camera]) -> list[tuple[Camera, list[int]]]:
    """Each different camera with the sightings that are its own."""
    mine: dict[int, tuple[Camera, list[int]]] = {}
    for index, camera in enumerate(cameras):
        mine.setdefault(id(camera), (camera, []))[1].append(index)
    return list(mine.values())


def _planar_answers(seen: Floats, size_m: float) -> list[tuple[Floats, Floats]]:
    """Rotations (3, 3) and translations (3,) in front of the camera for one square's normalised corners (4, 2)."""
    if not np.isfinite(seen).all():
        return []
    try:
        _, turns, shifts, _ = cv2.solvePnPGeneric(
            _SQUARE * size_m, seen, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE_SQUARE
        )
    except cv2.error:  # corners on one line
        return []
    answers = [(np.asarray(cv2.Rodrigues(r)[0]), np.asarray(t).ravel()) for r, t in zip(turns, shifts, strict=True)]
    return [(r, t) for r, t in answers if np.isfinite(r).all() and np.isfinite(t).all() and t[2] > 0]


def _orthogonal_iteration(rotation: Floats, points: Floats, rays: Floats) -> tuple[Floats, Floats, Floats]:
    """Rotations (N, 3, 3), translations (N, 3) and mean squared distances (N,) of points (N, P, 3) from rays (N, P, 3).

    Each round projects the points onto their rays and fits the rotation to that (Lu et al. 2000, equations 20 to 25).
    """
    onto = rays[..., :, None] * rays[..., None, :] / np.sum(rays**2, axis=2)[..., None, None]
    inverse = np.linalg.inv(np.eye(3) - onto.mean(axis=1))
    middle = points - points.mean(axis=1, keepdims=True)
    for left in reversed(range(_ROUNDS + 1)):
        turned = np.einsum("nij,npj->npi", rotation, points)
        pull = np.einsum("npij,npj->npi", onto - np.eye(3), turned).mean(axis=1)
        translation = np.einsum("nij,nj->ni", inverse, pull)
        placed = turned + translation[:, None]
        projected = np.einsum("npij,npj->npi", onto, placed)
        if left:
            aim = projected - projected.mean(axis=1, keepdims=True)
            u, _, vt = np.linalg.svd(np.einsum("npi,npj->nij", aim, middle))
            sign = np.ones((len(u), 3))
            sign[:, 2] = np.sign(np.linalg.det(u @ vt))
            rotation = (u * sign[:, None, :]) @ vt
    return rotation, translation, np.mean(np.sum((placed - projected) ** 2, axis=2), axis=1)
