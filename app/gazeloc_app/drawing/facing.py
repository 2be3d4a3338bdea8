"""Where to stand to look at a place: where a camera of the reconstruction stood that had it in view."""

from __future__ import annotations

import numpy as np

from gazeloc_app.data import ProjectData
from gazeloc_app.placement import shown_scan_from_sfm
from gazeloc_app.state import AppState
from gazeloc_core.arrays import Floats
from gazeloc_core.keypoints import Point

DISTANCE_M = 1.5
_BLOCKED_M = 0.1
_TRIED = 12


def place_to_stand(data: ProjectData, state: AppState, in_scan: Point) -> Floats:
    """An eye (3,) in the frame `scan` from which the place is seen, some 1.5 m away where there is one.

    Eyes are on the lines from the place to the cameras that had it in view, the one that stood best first; walls
    between rule one out. Where none is left, one is taken above the place.
    """
    place = np.array(in_scan)
    model, scan_from_sfm = data.model(state.recording), shown_scan_from_sfm(data, state)
    if model is None or scan_from_sfm is None or len(model) == 0:
        return place + np.array([0.3, 0.3, 1.0]) * DISTANCE_M
    poses = scan_from_sfm.compose_pose(model.sfm_from_camera)
    centers = np.asarray(poses.translation).reshape(-1, 3)
    away = np.linalg.norm(centers - place, axis=1)
    ahead = ((place - centers) * poses.rotation.as_matrix().reshape(-1, 3, 3)[:, :, 2]).sum(axis=1)
    order = np.lexsort((np.abs(away - DISTANCE_M), ahead < 0.7 * away))[:_TRIED]
    rays = centers[order] - place
    hits = data.raycaster().cast(centers[order], -rays)
    is_clear = ~hits.is_hit | (np.abs(hits.distance - 1) * away[order] < _BLOCKED_M)
    best = order[np.flatnonzero(is_clear)[0]] if is_clear.any() else order[0]
    toward = (centers[best] - place) / max(float(away[best]), 1e-9)
    return np.asarray(place + toward * min(float(away[best]), DISTANCE_M))
