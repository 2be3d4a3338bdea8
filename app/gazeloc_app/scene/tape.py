"""A measuring tape between two places, with its length in centimetres."""

from __future__ import annotations

import numpy as np
import viser

from gazeloc_app.palette import TAPE
from gazeloc_app.scene.placing import NodeGroup
from gazeloc_core.arrays import Floats
from gazeloc_core.keypoints import Point

_END_RADIUS_M = 0.015


class TapeLayer:
    """The ends at `/tape/0` and `/tape/1`, the line between them at `/tape/line`, the length at `/tape/length`."""

    def __init__(self, scene: viser.SceneApi, size: float = 1.0):
        """`size` multiplies the ends' size (`sizes.size_factor`)."""
        self._scene, self._size = scene, size
        self._ends: NodeGroup[Point] = NodeGroup(self._make_end)
        self._lines: NodeGroup[tuple[Point, Point]] = NodeGroup(self._make_line)
        self._lengths: NodeGroup[tuple[Point, str]] = NodeGroup(self._make_length)

    def show(self, ends_in_scan: tuple[Point, ...], length: str = "") -> None:
        """Draw none, one or two ends, and between two the line with its `length`."""
        self._ends.show({f"/tape/{number}": point for number, point in enumerate(ends_in_scan)})
        if len(ends_in_scan) < 2:
            self._lines.show({})
            self._lengths.show({})
            return
        start, end = ends_in_scan
        x, y, z = ((a + b) / 2 for a, b in zip(start, end, strict=True))
        self._lines.show({"/tape/line": (start, end)})
        self._lengths.show({"/tape/length": ((x, y, z), length)})

    def _make_end(self, name: str, point: Point) -> viser.IcosphereHandle:
        return self._scene.add_icosphere(
            name,
            radius=self._size * _END_RADIUS_M,
            color=TAPE,
            position=np.array(point),
            cast_shadow=False,
            receive_shadow=False,
        )

    def _make_line(self, name: str, ends: tuple[Point, Point]) -> viser.LineSegmentsHandle:
        return self._scene.add_line_segments(
            name, np.array([ends]), np.array(TAPE), thickness=3.0, thickness_units="screen"
        )

    def _make_length(self, name: str, spec: tuple[Point, str]) -> viser.LabelHandle:
        point, length = spec
        return self._scene.add_label(name, length, position=np.array(point))


def length_text(start_in_scan: Point, end_in_scan: Point, up: Floats) -> str:
    """The distance in centimetres, and where it matters how much of it is upwards; `up` (3,) is a unit vector."""
    between = np.subtract(end_in_scan, start_in_scan)
    length, rise = float(np.linalg.norm(between)), abs(float(between @ up))
    text = f"{100 * length:.1f} cm"
    return f"{text} ({100 * rise:.1f} cm up)" if 0.05 * length < rise < 0.95 * length else text
