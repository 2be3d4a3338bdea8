"""Keypoints as one camera sees them: the clicks in its frame, where the others' places should be, and epipolar lines.

A place that is known on one side (clicked in the cloud or on the mesh, or triangulated from two clicks) has an expected
pixel. A place of which one click in one other frame is known lies on that click's ray, which this camera sees
as a line (straight without distortion: the epipolar line).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import RigidTransform

from gazeloc_core.arrays import Floats
from gazeloc_core.camera import Camera

NEAREST_M, FARTHEST_M, STEPS = 0.2, 30.0, 160


@dataclass(frozen=True)
class View:
    """A camera at a pose `scan_from_camera`."""

    camera: Camera
    scan_from_camera: RigidTransform

    def pixel_of(self, in_scan: ArrayLike) -> tuple[float, float] | None:
        """The pixel of a place (3,) in the frame `scan`; None where it is outside of the picture."""
        pixel = self.camera.project(self.scan_from_camera.inv().apply(np.asarray(in_scan, dtype=np.float64)))[0]
        return (float(pixel[0]), float(pixel[1])) if self.camera.contains(pixel)[0] else None

    def ray_of(self, x_px: float, y_px: float) -> tuple[Floats, Floats]:
        """Origin and unit direction (3,) in the frame `scan` of a pixel."""
        ray = self.camera.unproject([[x_px, y_px]])[0]
        return np.array(self.scan_from_camera.translation), np.asarray(self.scan_from_camera.rotation.apply(ray))


def line_of_click(seen_by: View, x_px: float, y_px: float, in_view: View) -> Floats:
    """Where in `in_view` the place may be that was clicked in `seen_by`: pixels (N, 2) along a line, near first.

    Only what is in the picture, from 20 cm to 30 m before the camera of the click; (0, 2) where nothing is.
    """
    origin, direction = seen_by.ray_of(x_px, y_px)
    if not np.isfinite(direction).all():
        return np.zeros((0, 2))
    along = np.geomspace(NEAREST_M, FARTHEST_M, STEPS)
    in_camera = in_view.scan_from_camera.inv().apply(origin + along[:, None] * direction)
    pixels = in_view.camera.project(in_camera)
    return np.asarray(pixels[in_view.camera.contains(pixels)])
