"""What a viewer draws of a scan: a GLB of few faces, turned to where it was scanned from; and a first glimpse."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from gazeloc_core.arrays import Bytes, Floats, Ints
from gazeloc_core.scan import Mesh, Texture
from gazeloc_core.surfaces.display_mesh import MAX_FACES, display_mesh
from gazeloc_core.surfaces.glb import NO_COLOR, NO_PICTURE, Glb, mesh_glb
from gazeloc_core.surfaces.viewpoint import facing


@dataclass(frozen=True, eq=False)
class ScanDisplay:
    """A scan made fit for the screen. Picks and measurements use the scan's own mesh, never this."""

    glb: Glb
    front: int
    """The side of the scan's own faces that is drawn: 1 where their normals point to, -1 the other, 0 both."""
    faces: int
    """How many faces are drawn."""
    faces_of_scan: int


def scan_display(mesh: Mesh, viewpoints: ArrayLike, max_faces: int = MAX_FACES) -> ScanDisplay:
    """The mesh for the screen, seen from where it was scanned, `viewpoints` (N, 3) in the frame `scan`.

    Takes seconds at a million faces; the stage in stages/display.py keeps it.
    """
    displayed = display_mesh(mesh, max_faces)
    turned, is_clear = facing(displayed, viewpoints)
    front = (1 if turned is displayed else -1) if is_clear else 0
    return ScanDisplay(mesh_glb(turned), front, len(turned.faces), len(mesh.faces))


def glimpse(mesh: Mesh, count: int) -> tuple[Floats, Bytes]:
    """Middles (N, 3) of at most `count` faces, evenly many of the file's order, and their colours (N, 3) in sRGB.

    Made in milliseconds from any mesh: the scan's true places and colours, to be shown until more is ready.
    """
    rows: Ints = np.arange(0, len(mesh.faces), -(-len(mesh.faces) // count), dtype=np.int64)
    corners = mesh.faces[rows]
    points = np.asarray(mesh.vertices[corners].mean(axis=1))
    if mesh.texture is not None:
        return points, _texture_colors(mesh.texture, rows)
    if mesh.colors is not None:
        return points, np.rint(mesh.colors[corners].mean(axis=1)).astype(np.uint8)
    return points, np.tile(np.array(NO_COLOR, dtype=np.uint8), (len(rows), 1))


def _texture_colors(texture: Texture, rows: Ints) -> Bytes:
    """The picture's colours (N, 3) in the middle of some faces."""
    colors = np.tile(np.array(NO_PICTURE, dtype=np.uint8), (len(rows), 1))
    uv, number = texture.uv_of_corner[rows].mean(axis=1) % 1.0, texture.image_of_face[rows]
    for index, image in enumerate(texture.images):
        here = number == index
        height, width = image.shape[:2]
        x = np.minimum((uv[here, 0] * width).astype(np.int64), width - 1)
        y = np.minimum(((1 - uv[here, 1]) * height).astype(np.int64), height - 1)
        colors[here] = image[y, x]
    return colors
