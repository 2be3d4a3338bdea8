"""Where the reconstruction is drawn: where the alignment in force puts it, or before there is one, at a likely place.

The likely place is for the eye and the mouse alone: no pose, export or residual ever comes from it.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.spatial.transform import Rotation

from gazeloc_app.data import ProjectData
from gazeloc_app.state import AppState
from gazeloc_core.arrays import Floats
from gazeloc_core.scan import Mesh
from gazeloc_core.sfm_model import SfmModel
from gazeloc_core.surfaces.viewpoint import up_vector
from gazeloc_core.transforms import Similarity


def shown_scan_from_sfm(data: ProjectData, state: AppState) -> Similarity | None:
    """Where the reconstruction is drawn: by the alignment in force, else a likely place; None without one."""
    alignment = data.alignment(state.recording, state.annotation.alignment)
    if alignment is not None:
        return alignment.scan_from_sfm
    model = data.model(state.recording)
    if model is None:
        return None
    return likely_scan_from_sfm(model, data.mesh(), data.scan().up_axis)


@lru_cache(maxsize=4)
def likely_scan_from_sfm(model: SfmModel, mesh: Mesh, up_axis: str) -> Similarity:
    """The similarity that makes the reconstruction upright, as large as the scan, and centred in it.

    Upright: people hold their heads up, so the cameras' mean "down" is the scan's.
    """
    down_in_sfm = model.sfm_from_camera.rotation.as_matrix()[:, :, 1].mean(axis=0)
    rotation = _shortest_turn(-down_in_sfm, up_vector(up_axis))
    points = model.points if len(model.points) else np.asarray(model.sfm_from_camera.translation)
    turned = points @ rotation.as_matrix().T
    scale = _extent(mesh.vertices) / max(_extent(turned), 1e-9)
    offset = np.median(mesh.vertices, axis=0) - scale * np.median(turned, axis=0)
    return Similarity(scale, rotation, offset)


def _extent(points: Floats) -> float:
    low, high = np.percentile(points, [5, 95], axis=0)
    return float(np.linalg.norm(high - low))


def _shortest_turn(start: Floats, end: Floats) -> Rotation:
    a, b = start / max(float(np.linalg.norm(start)), 1e-12), end / np.linalg.norm(end)
    axis, cosine = np.cross(a, b), float(a @ b)
    if cosine < -0.999999:
        side = np.cross(a, np.eye(3)[int(np.abs(a).argmin())])
        return Rotation.from_rotvec(np.pi * side / np.linalg.norm(side))
    return Rotation.from_quat([*axis, 1 + cosine])
