"""Where to look at a room from, and which sides of its faces look into it."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import ArrayLike

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
_CLEAR_MAJORITY = 0.65
"""Share of the mesh's area that must face the viewpoints before back sides are hidden."""


def up_vector(up_axis: str) -> Floats:
    """The direction (3,) of a scan's `up_axis`, e.g. "z" or "-y"."""
    vector = np.zeros(3)
    vector["xyz".index(up_axis[-1])] = -1.0 if up_axis.startswith("-") else 1.0
    return vector


def room_corners(mesh: Mesh) -> tuple[Floats, Floats]:
    """Lowest and highest corner (3,) of the room: the 1st and the 99th percentile, single far-off points left out."""
    low, high = np.percentile(mesh.vertices[:: max(1, len(mesh.vertices) // _SAMPLE)], [1, 99], axis=0)
    return low, high


def overview(mesh: Mesh, up_axis: str) -> tuple[Floats, Floats]:
    """Eye and look-at point (3,) of a view from above one corner that just has the whole room in it.

    Single far-off points, as scans have them, do not count: the room is between the 1st and the 99th percentile.
    """
    sample = mesh.vertices[:: max(1, len(mesh.vertices) // _SAMPLE)]
    low, high = room_corners(mesh)
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


def facing(mesh: Mesh, viewpoints: ArrayLike) -> tuple[Mesh, bool]:
    """The mesh with its faces turned towards `viewpoints` (N, 3), from where it was scanned, and whether that is clear.

    Only where it is clear may faces be hidden from behind. Every face votes with its area, by the side of it on which
    the viewpoints' median lies.
    """
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    towards = np.median(np.asarray(viewpoints, dtype=np.float64).reshape(-1, 3), axis=0) - (a + b + c) / 3
    area = np.linalg.norm(normals, axis=1)
    share = float(area[np.einsum("ij,ij->i", normals, towards) > 0].sum() / max(area.sum(), 1e-30))
    if share >= 0.5:
        return mesh, share >= _CLEAR_MAJORITY
    texture = mesh.texture
    if texture is not None:
        texture = dataclasses.replace(texture, uv_of_corner=texture.uv_of_corner[:, ::-1])
    return dataclasses.replace(mesh, faces=mesh.faces[:, ::-1], texture=texture), 1 - share >= _CLEAR_MAJORITY
