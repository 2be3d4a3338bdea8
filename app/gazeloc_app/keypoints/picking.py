"""From a click to what it means: pure geometry of rays, no viewer.

A click on the scene comes as a ray in the viewer's world, which is the frame `scan`: an origin and a direction of any
length. Angles are between rays from the same eye, so that "8 pixels beside it" is an angle whatever the distance.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import RigidTransform

from gazeloc_app.scene.kept import EVERYTHING, Kept
from gazeloc_core.arrays import Floats
from gazeloc_core.camera import Camera
from gazeloc_core.surfaces.raycast import Raycaster

CLICK_RADIUS_PX = 8.0
_SAME_CLICK_S = 0.15
_SAME_CLICK_RAD = 0.01

_MOST_FACES_PASSED = 64
_PAST_A_FACE = 1e-4


def tolerance_rad(fov_rad: float, height_px: float, radius_px: float = CLICK_RADIUS_PX) -> float:
    """The angle of `radius_px` pixels in the middle of a view `height_px` high with this vertical field of view."""
    return float(np.arctan(2 * np.tan(fov_rad / 2) * radius_px / height_px))


def pick_mesh(
    raycaster: Raycaster,
    origin: ArrayLike,
    direction: ArrayLike,
    front: int = 0,
    kept: Kept = EVERYTHING,
) -> Floats | None:
    """The point (3,) where the ray first meets a face that is drawn, None for a miss.

    `front`: 1 where faces are drawn from the side that their normals point to, -1 from the other, 0 from both. A wall
    that is not drawn from behind must not catch the click on what is seen through it. Nor must what is cut away.
    """
    ray = np.asarray(direction, dtype=np.float64)
    start = kept.begin(np.asarray(origin, dtype=np.float64), ray)
    if start is None:
        return None
    for _ in range(_MOST_FACES_PASSED):
        hits = raycaster.cast(start, ray)
        if not hits.is_hit[0]:
            return None
        if front == 0 or front * float(raycaster.normals(hits)[0] @ ray) < 0:
            point = np.asarray(raycaster.points(hits)[0], dtype=np.float64)
            if kept.has(point):
                return point
        start = start + ray * (float(hits.distance[0]) + _PAST_A_FACE)
    return None


def pick_cloud(
    points: ArrayLike, origin: ArrayLike, direction: ArrayLike, tolerance: float, kept: Kept = EVERYTHING
) -> int | None:
    """The front-most of `points` (N, 3) within `tolerance` radians of the ray; of equally near ones the best centred.

    Front-most, not best centred: what a person clicks is what they see, and nearer points hide those behind. Points and
    ray must be in one frame. What is cut away is not meant.
    """
    angles, distances = angles_to_ray(points, origin, direction)
    within = np.flatnonzero((angles <= tolerance) & kept.has(points))
    if len(within) == 0:
        return None
    return int(within[np.lexsort((angles[within], distances[within]))[0]])


def pick_frustum(
    centers: ArrayLike,
    forward: ArrayLike,
    origin: ArrayLike,
    direction: ArrayLike,
    depth_m: float,
    tolerance: float,
    kept: Kept = EVERYTHING,
) -> int | None:
    """The camera whose pyramid the ray passes best within `tolerance` radians; of equally good ones the nearest.

    `centers` (N, 3), and unit viewing directions `forward` (N, 3); `depth_m` is the pyramids' height. Of a pyramid that
    is cut through, what is left counts.
    """
    c, f = np.asarray(centers, dtype=np.float64), np.asarray(forward, dtype=np.float64)
    if len(c) == 0:
        return None
    places = [c + share * depth_m * f for share in (0.0, 0.5, 1.0)]
    along = [angles_to_ray(place, origin, direction) for place in places]
    seen = [np.where(kept.has(place), angle, np.inf) for place, (angle, _) in zip(places, along, strict=True)]
    angles = np.min(seen, axis=0)
    best = int(np.lexsort((along[0][1], angles))[0])
    return best if angles[best] <= tolerance else None


def angles_to_ray(points: ArrayLike, origin: ArrayLike, direction: ArrayLike) -> tuple[Floats, Floats]:
    """Angle (N,) between the ray and the line from its origin to each point, and the distance (N,) along the ray.

    Points behind the origin have an angle above 90°.
    """
    offsets = np.asarray(points, dtype=np.float64).reshape(-1, 3) - np.asarray(origin, dtype=np.float64)
    axis = np.asarray(direction, dtype=np.float64)
    axis = axis / np.linalg.norm(axis)
    along = offsets @ axis
    across = np.linalg.norm(offsets - along[:, None] * axis, axis=1)
    return np.arctan2(across, along), along  # unlike arccos exact for small angles


def pixel_in_frame(
    camera: Camera, scan_from_camera: RigidTransform, origin: ArrayLike, direction: ArrayLike, plane_m: float
) -> Floats | None:
    """The pixel (2,) of a frame that a click met, whose picture stands `plane_m` before its camera; None beside it.

    Seen from the camera's own place the plane's distance does not matter; it does when the viewer has moved.
    """
    camera_from_scan = scan_from_camera.inv()
    start = np.asarray(camera_from_scan.apply(np.array(origin, dtype=np.float64)))
    ray = np.asarray(camera_from_scan.rotation.apply(np.array(direction, dtype=np.float64)))
    if abs(ray[2]) < 1e-12:
        return None
    distance = (plane_m - start[2]) / ray[2]
    if distance <= 0:
        return None
    pixel = camera.project([start + distance * ray])
    return pixel[0] if camera.contains(pixel)[0] else None


@dataclass
class ClickFilter:
    """Lets every click through once: a double click comes as two events with nearly the same ray. One per browser."""

    _last_s: float = field(default=-np.inf)
    _last_direction: Floats = field(default_factory=lambda: np.zeros(3))

    def is_new(self, time_s: float, direction: ArrayLike) -> bool:
        """Whether this click, at a time of a steady clock, is another one than the last."""
        axis = np.asarray(direction, dtype=np.float64)
        axis = axis / np.linalg.norm(axis)
        is_soon = time_s - self._last_s < _SAME_CLICK_S
        is_near = float(np.linalg.norm(axis - self._last_direction)) < _SAME_CLICK_RAD
        self._last_s, self._last_direction = time_s, axis
        return not (is_soon and is_near)
