"""Where the viewer stands when the page opens, and which way is up."""

from __future__ import annotations

import viser

from gazeloc_core.scan import Mesh
from gazeloc_core.surfaces.viewpoint import FOV_RAD, overview, up_vector


def set_start(server: viser.ViserServer, mesh: Mesh, up_axis: str) -> None:
    """Point up where the scan's up is, and let every new browser start with the overview."""
    up = up_vector(up_axis)
    server.scene.set_up_direction(up)
    eye, target = overview(mesh, up_axis)
    server.initial_camera.position = eye
    server.initial_camera.look_at = target
    server.initial_camera.up = up
    server.initial_camera.fov = FOV_RAD
