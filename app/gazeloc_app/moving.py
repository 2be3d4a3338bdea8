"""Moving a keypoint that is there along the scan's surface: dragged by the mouse, or nudged by the arrow keys."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from gazeloc_app.keypoints.picking import pick_mesh
from gazeloc_core.arrays import Floats
from gazeloc_core.keypoints import Point
from gazeloc_core.raycast import Raycaster

STEP_M, LONG_STEP_M = 0.002, 0.01
"""How far a nudge goes, and one with the shift key."""
ARROWS = {"arrowleft": (-1, 0), "arrowright": (1, 0), "arrowup": (0, -1), "arrowdown": (0, 1)}
"""Directions on the screen by key, x to the right and y down."""


def nudged(raycaster: Raycaster, point: Point, step_m: float, screen: tuple[int, int], camera_wxyz: Floats) -> Point:
    """The place on the surface `step_m` beside a point, in a direction of the screen.

    The direction is that of the view laid onto the surface, so that every press of a key goes equally far, however
    slanted the wall; where the surface faces away from the direction altogether, the view's own is taken.
    """
    right, down, _ = Rotation.from_quat(np.asarray(camera_wxyz)[[1, 2, 3, 0]]).as_matrix().T
    wanted = screen[0] * right + screen[1] * down
    place = np.array(point)
    normal = raycaster.normals(raycaster.closest(place))[0]
    along = wanted - (wanted @ normal) * normal
    direction = along if np.linalg.norm(along) > 0.1 else wanted
    beside = place + step_m * direction / np.linalg.norm(direction)
    x, y, z = raycaster.points(raycaster.closest(beside))[0].tolist()
    return x, y, z


def dragged(raycaster: Raycaster, eye: Floats, pointer: Floats, front: int) -> Point | None:
    """Where on the surface a marker is that was dragged to the pointer, a place in the view; None beside the scan."""
    ray = np.asarray(pointer, dtype=np.float64) - np.asarray(eye, dtype=np.float64)
    if not np.isfinite(ray).all() or np.linalg.norm(ray) < 1e-9:
        return None
    found = pick_mesh(raycaster, eye, ray, front)
    if found is None:
        return None
    x, y, z = found.tolist()
    return x, y, z
