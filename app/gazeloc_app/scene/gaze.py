"""Where the person looks: the ray from the eye-tracking camera and the place it meets the room."""

from __future__ import annotations

import numpy as np
import viser

from gazeloc_app.palette import GAZE
from gazeloc_app.scene.placing import NodeGroup
from gazeloc_core.arrays import Floats
from gazeloc_core.keypoints import Point

_MISS_LENGTH_M = 5.0
_HIT_RADIUS_M = 0.035


class GazeLayer:
    """The gaze ray at `/gaze/ray` and, where it meets the scan, the point at `/gaze/hit`."""

    def __init__(self, scene: viser.SceneApi):
        self._scene = scene
        self._rays: NodeGroup[tuple[Point, Point]] = NodeGroup(self._make_ray)
        self._hits: NodeGroup[Point] = NodeGroup(self._make_hit)
        self.size = 1.0
        """By what the point's size is multiplied from now on (`sizes.size_factor`)."""

    def show(self, origin: Floats | None, direction: Floats | None = None, hit: Floats | None = None) -> None:
        """Draw the ray from `origin` (3,) to its `hit` (3,), or where it has none 5 m along `direction`; None: none."""
        if origin is None or (hit is None and direction is None):
            self._rays.show({})
            self._hits.show({})
            return
        end = hit
        if end is None:
            assert direction is not None
            end = origin + _MISS_LENGTH_M * direction / np.linalg.norm(direction)
        self._rays.show({"/gaze/ray": (_point(origin), _point(end))})
        self._hits.show({"/gaze/hit": _point(hit)} if hit is not None else {})

    def set_visible(self, visible: bool) -> None:
        """Show or hide the layer."""
        self._rays.set_visible(visible)
        self._hits.set_visible(visible)

    def _make_ray(self, name: str, ends: tuple[Point, Point]) -> viser.LineSegmentsHandle:
        return self._scene.add_line_segments(
            name, np.array([ends]), np.array(GAZE), thickness=3.0, thickness_units="screen"
        )

    def _make_hit(self, name: str, point: Point) -> viser.IcosphereHandle:
        return self._scene.add_icosphere(
            name,
            radius=self.size * _HIT_RADIUS_M,
            color=GAZE,
            opacity=0.8,
            position=np.array(point),
            cast_shadow=False,
            receive_shadow=False,
        )


def _point(values: Floats) -> Point:
    x, y, z = (float(value) for value in values)
    return x, y, z
