"""Clicks in frames as keypoints: where a frame's camera is, and what clicks in several frames triangulate to."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import RigidTransform

from gazeloc_app.actions.picks import Side
from gazeloc_app.data import ProjectData
from gazeloc_app.placement import shown_scan_from_sfm
from gazeloc_app.state import AppState
from gazeloc_core.clicks.scan_clicks import triangulate_on_scan
from gazeloc_core.errors import GeometryError
from gazeloc_core.keypoints import Point, Sighting
from gazeloc_core.triangulation import TriangulatedPoint, triangulate_sightings


def frame_pose(data: ProjectData, state: AppState, frame: int) -> RigidTransform | None:
    """Where a registered frame's camera is drawn (`scan_from_camera`); None for a frame that is not registered."""
    model, image = data.model(state.recording), image_of_frame(data, state.recording, frame)
    scan_from_sfm = shown_scan_from_sfm(data, state)
    if model is None or image is None or scan_from_sfm is None:
        return None
    return scan_from_sfm.compose_pose(model.sfm_from_camera[image])


def image_of_frame(data: ProjectData, recording: str, frame: int) -> int | None:
    """Which image of the reconstruction a frame is; None for a frame that was not registered."""
    model = data.model(recording)
    if model is None:
        return None
    images = np.flatnonzero(model.frame_indices == frame)
    return int(images[0]) if len(images) else None


def triangulated(
    data: ProjectData, recording: str, sightings: tuple[Sighting, ...], side: Side = Side.SFM
) -> tuple[Point, float] | str:
    """The point on one side that clicks in frames agree on and its standard deviation; else why there is none.

    On the side of the reconstruction the frames are the recording's, undistorted; on the scan's they are the phone's.
    """
    try:
        found = (
            triangulate_on_scan(data.scan(), sightings)
            if side is Side.SCAN
            else _in_reconstruction(data, recording, sightings)
        )
    except GeometryError as error:
        return str(error)
    x, y, z = (float(value) for value in found.point)
    if not found.is_reliable:
        return f"The clicks disagree by {found.rms_px:.0f} px; they do not show the same place, click it again."
    return (x, y, z), found.sigma


def _in_reconstruction(data: ProjectData, recording: str, sightings: tuple[Sighting, ...]) -> TriangulatedPoint:
    model, camera = data.model(recording), data.camera(recording)
    if model is None or camera is None:
        raise GeometryError("There is no reconstruction yet; run the stages first.")
    image_of_frame = {int(frame): image for image, frame in enumerate(model.frame_indices)}
    usable = [sighting for sighting in sightings if sighting.frame_index in image_of_frame]
    if len(usable) < 2:
        raise GeometryError("Only one of the clicked frames is in the reconstruction; click the spot in another one.")
    poses = model.sfm_from_camera[[image_of_frame[sighting.frame_index] for sighting in usable]]
    return triangulate_sightings([camera] * len(usable), poses, [(s.x_px, s.y_px) for s in usable])
