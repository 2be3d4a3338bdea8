"""Places on the scan from clicks in the phone's posed frames.

A click on the mesh takes over the mesh's error: lidar rounds off edges, and its depth may differ in scale from the path
that the phone reports (by 3 % in a real scan). The rays of clicks in two or more frames need no mesh.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import RigidTransform

from gazeloc_core.errors import GeometryError
from gazeloc_core.keypoints import Sighting
from gazeloc_core.scan import RoomScan
from gazeloc_core.triangulation import TriangulatedPoint, TriangulationOptions, triangulate_sightings


@dataclass(frozen=True, kw_only=True)
class ScanClickOptions:
    """What clicks in the phone's frames are assumed to be off by, and which of them determine a place."""

    click_px: float = 1.5
    """By how much a person's click in a frame is off, per axis."""
    pose_error_deg: float = 0.2
    """What the phone's directions are assumed to be off by."""
    min_parallax_deg: float = 5.0
    """Least angle between two rays of a place."""
    max_rms_sigmas: float = 3.0
    """Clicks that disagree by more than this many times what they are assumed to be off by show different places."""

    def triangulation(self, focal_px: float) -> TriangulationOptions:
        """How the rays are joined in frames of this focal length: the pose is off by more pixels than the click."""
        off_px = float(np.hypot(self.click_px, focal_px * np.radians(self.pose_error_deg)))
        return TriangulationOptions(
            huber_px=off_px,
            min_parallax_deg=self.min_parallax_deg,
            max_rms_px=self.max_rms_sigmas * off_px,
            click_px=off_px,
        )


def triangulate_on_scan(
    scan: RoomScan, sightings: Sequence[Sighting], options: ScanClickOptions | None = None
) -> TriangulatedPoint:
    """The place in the frame `scan` that was clicked in phone frames; `frame_index` counts `scan.frames_with_images`.

    Raises:
        GeometryError: if a sighting names a frame that the scan does not have, and see `triangulate_sightings`.
    """
    options = options or ScanClickOptions()
    frames = scan.frames_with_images
    unknown = [s.frame_index for s in sightings if not 0 <= s.frame_index < len(frames)]
    if unknown:
        raise GeometryError(
            f"{scan.path}: there is no phone frame {unknown[0]} with a picture ({len(frames)} have one); "
            "delete the keypoint and click it again."
        )
    if len(sightings) < 2:
        raise GeometryError(
            f"A place on the scan needs clicks in at least two of the phone's frames, got {len(sightings)}; "
            "click it in another frame."
        )
    seen_by = [frames[sighting.frame_index] for sighting in sightings]
    cameras = [frame.camera for frame in seen_by]
    poses = RigidTransform.concatenate([frame.scan_from_camera for frame in seen_by])
    focal_px = float(np.mean([camera.focal_px.mean() for camera in cameras]))
    pixels = [(sighting.x_px, sighting.y_px) for sighting in sightings]
    return triangulate_sightings(cameras, poses, pixels, options.triangulation(focal_px))
