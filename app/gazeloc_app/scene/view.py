"""Where the viewer stands when the page opens, and which way is up."""

from __future__ import annotations

import numpy as np
import viser

from gazeloc_core.arrays import Floats
from gazeloc_core.scan import Mesh

FOV_RAD = float(np.radians(50.0))
"""Narrower than viser's 75°: a pixel covers less of the room, so clicks are finer."""
_FROM_ABOVE_RAD = float(np.radians(38.0))
_MARGIN = 0.9
"""Share of the view that the room fills."""
_ASPECT = 0.8
"""Width by height of the narrowest view in which the room still fits, panels beside it."""
_SAMPLE = 20_000


def up_vector(up_axis: str) -> Floats:
    """The direction (3,) of a scan's `up_axis`, e.g. "z" or "-y"."""
    vector = np.zeros(3)
    vector["xyz".index(up_axis[-1])] = -1.0 if up_axis.startswith("-") else 1.0
    return vector


def overview(mesh: Mesh, up_axis: str) -> tuple[Floats, Floats]:
    """Eye and look-at point (3,) of a view from above one corner that just has the whole room in it.

    Single far-off points, as scans have them, do not count: the room is between the 1st and the 99th percentile.
    """
    sample = mesh.vertices[:: max(1, len(mesh.vertices) // _SAMPLE)]
    low, high = np.percentile(sample, [1, 99], axis=0)
    centre, up = (low + high) / 2, up_vector(up_axis)
    level = np.ones(3) - np.abs(up)
    level[np.flatnonzero(level)[0]] *= 0.7  # not along the diagonal, which would hide the corner's edges
    level /= np.linalg.norm(level)
    back = np.cos(_FROM_ABOVE_RAD) * level + np.sin(_FROM_ABOVE_RAD) * up
    right = np.cross(up, back) / np.linalg.norm(np.cross(up, back))
    points = np.clip(sample, low, high) - centre
    tangent = _MARGIN * np.tan(FOV_RAD / 2)
    # A point at x, y beside the axis is in view from the distance at which x and y are within the view's tangent.
    across = np.maximum(np.abs(points @ right) / _ASPECT, np.abs(points @ np.cross(back, right)))
    return centre + back * max(float((across / tangent + points @ back).max()), 0.3), centre


def set_start(server: viser.ViserServer, mesh: Mesh, up_axis: str) -> None:
    """Point up where the scan's up is, and let every new browser start with the overview."""
    up = up_vector(up_axis)
    server.scene.set_up_direction(up)
    eye, target = overview(mesh, up_axis)
    server.initial_camera.position = eye
    server.initial_camera.look_at = target
    server.initial_camera.up = up
    server.initial_camera.fov = FOV_RAD
