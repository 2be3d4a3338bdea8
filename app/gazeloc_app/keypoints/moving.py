"""Moving a keypoint that is there, on the scan's surface or in the view: dragged by the mouse, or by arrow keys."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from gazeloc_app.keypoints.picking import pick_mesh
from gazeloc_app.scene.kept import EVERYTHING, Kept
from gazeloc_core.arrays import Floats
from gazeloc_core.keypoints import Point
from gazeloc_core.surfaces.raycast import Raycaster

STEP_M, LONG_STEP_M = 0.002, 0.01
"""How far a nudge goes in the room, and one with the shift key."""
STEP_PX, FINE_STEP_PX = 1.0, 0.1
"""The same in a frame, where clicks are right to a pixel or so already."""
ARROWS = {"arrowleft": (-1, 0), "arrowright": (1, 0), "arrowup": (0, -1), "arrowdown": (0, 1)}
"""Directions on the screen by key, x to the right and y down."""


class Nudge(NamedTuple):
    """An arrow key: a direction of the screen, and how far that goes in the room and in a frame."""

    screen: tuple[int, int]
    step_m: float = STEP_M
    step_px: float = STEP_PX


def nudge_of(key: str, *, is_shifted: bool) -> Nudge:
    """What an arrow key means: 2 mm or a pixel, with the shift key 1 cm or a tenth of a pixel."""
    steps = (LONG_STEP_M, FINE_STEP_PX) if is_shifted else (STEP_M, STEP_PX)
    return Nudge(ARROWS[key], *steps)


def nudged(raycaster: Raycaster, point: Point, nudge: Nudge, camera_wxyz: Floats) -> Point:
    """The place on the surface a nudge beside a point.

    The direction is that of the view laid onto the surface, so that every press of a key goes equally far, however
    slanted the wall; where the surface faces away from the direction altogether, the view's own is taken.
    """
    wanted = _in_scan(nudge, camera_wxyz)
    place = np.array(point)
    normal = raycaster.normals(raycaster.closest(place))[0]
    along = wanted - (wanted @ normal) * normal
    direction = along if np.linalg.norm(along) > 0.1 else wanted
    beside = place + nudge.step_m * direction / np.linalg.norm(direction)
    x, y, z = raycaster.points(raycaster.closest(beside))[0].tolist()
    return x, y, z


def nudged_in_view(place: Floats, nudge: Nudge, camera_wxyz: Floats) -> Floats:
    """The place (3,) a nudge beside one in the frame `scan`, as far from the camera's plane as before."""
    return np.asarray(place + nudge.step_m * _in_scan(nudge, camera_wxyz))


def _in_scan(nudge: Nudge, camera_wxyz: Floats) -> Floats:
    """The unit direction (3,) in the frame `scan` of a direction on the screen."""
    right, down, _ = Rotation.from_quat(np.asarray(camera_wxyz)[[1, 2, 3, 0]]).as_matrix().T
    return np.asarray(nudge.screen[0] * right + nudge.screen[1] * down)


def dragged(raycaster: Raycaster, eye: Floats, pointer: Floats, front: int, kept: Kept = EVERYTHING) -> Point | None:
    """Where on the surface a marker is that was dragged to the pointer, a place in the view; None beside the scan."""
    ray = np.asarray(pointer, dtype=np.float64) - np.asarray(eye, dtype=np.float64)
    if not np.isfinite(ray).all() or np.linalg.norm(ray) < 1e-9:
        return None
    found = pick_mesh(raycaster, eye, ray, front, kept)
    if found is None:
        return None
    x, y, z = found.tolist()
    return x, y, z
