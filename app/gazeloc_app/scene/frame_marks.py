"""Keypoints on the picture that a browser looks through: crosses where they were clicked or are expected, and lines."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import viser

from gazeloc_app.frames.frame_marks import Line, Mark
from gazeloc_app.palette import SCAN_SIDE, SELECTED, SFM_SIDE
from gazeloc_app.scene.frames import PLANE_M
from gazeloc_core.arrays import Floats
from gazeloc_core.clicks.keypoint_views import View

CLICKED, EXPECTED = SCAN_SIDE, SFM_SIDE
_BEFORE_PICTURE = 0.995
"""Share of the picture's distance at which marks stand, so that it does not cover them."""
_ARM = 0.014
"""Half a cross, as a share of the picture's width."""
_GRIP = 0.016
"""Radius of the ball at which a clicked mark is gripped, likewise."""


class FrameMarksLayer:
    """On one client's scene at `/picture-marks`; a clicked one is an upright cross, an expected one a slanted.

    Clicked ones can be gripped at a ball that is not seen: `on_drag(key, event)` hears of it.
    """

    def __init__(self, scene: viser.SceneApi, on_drag: Callable[[str, Any], None]):
        self._scene, self._on_drag = scene, on_drag
        self._handles: list[viser.SceneNodeHandle] = []

    def show(self, view: View | None, marks: Sequence[Mark], lines: Sequence[Line], selected: str | None) -> None:
        """Draw the marks and lines in the view; None takes them away."""
        for handle in self._handles:
            handle.remove()
        self._handles = []
        if view is None:
            return
        segments, colors = [np.zeros((0, 2, 3))], [np.zeros((0, 3))]
        for mark in marks:
            ends = _cross(mark, view.camera.width)
            segments.append(on_plane(view, ends.reshape(-1, 2)).reshape(-1, 2, 3))
            color = SELECTED if mark.key == selected else CLICKED if mark.is_clicked else EXPECTED
            colors.append(np.tile(color, (len(ends), 1)))
            at = on_plane(view, np.array([[mark.x_px, mark.y_px]]))[0]
            self._handles.append(
                self._scene.add_label(f"/picture-marks/{mark.key}", mark.name, position=at, anchor="bottom-left")
            )
            if mark.is_clicked:
                self._add_grip(view, mark.key, at)
        for line in lines:
            points = on_plane(view, line.pixels)
            segments.append(np.stack([points[:-1], points[1:]], axis=1))
            color = SELECTED if line.key == selected else EXPECTED
            colors.append(np.tile(color, (len(points) - 1, 1)))
        every = np.concatenate(segments)
        if len(every):
            both = np.repeat(np.concatenate(colors)[:, None], 2, axis=1).astype(np.uint8)
            self._handles.append(
                self._scene.add_line_segments(
                    "/picture-marks/lines", every, both, thickness=2.0, thickness_units="screen"
                )
            )

    def _add_grip(self, view: View, key: str, at: Floats) -> None:
        reach_px = _GRIP * view.camera.width
        grip = self._scene.add_icosphere(
            f"/picture-grips/{key}",
            radius=float(reach_px * PLANE_M / np.mean(view.camera.focal_px)),
            subdivisions=1,
            opacity=0.0,
            position=at,
            cast_shadow=False,
            receive_shadow=False,
        )

        async def dragged(event: Any) -> None:
            self._on_drag(key, event)

        handler: Any = dragged  # viser takes coroutines too, which its annotation does not say
        grip.on_drag("left")(handler)
        self._handles.append(grip)


def _cross(mark: Mark, width_px: int) -> Floats:
    """(2, 2, 2) the two strokes of a cross in pixels."""
    arm = _ARM * width_px
    strokes = np.array([[[-1, 0], [1, 0]], [[0, -1], [0, 1]]], dtype=np.float64)
    if not mark.is_clicked:
        strokes = np.array([[[-1, -1], [1, 1]], [[-1, 1], [1, -1]]]) * 0.7
    return np.array([mark.x_px, mark.y_px]) + arm * strokes


def on_plane(view: View, pixels: Floats) -> Floats:
    """Places (N, 3) in the frame `scan` of pixels (N, 2), just before the picture that is looked through."""
    rays = view.camera.unproject(pixels)
    rays = rays / rays[:, 2:] * PLANE_M * _BEFORE_PICTURE
    return np.asarray(view.scan_from_camera.apply(rays), dtype=np.float64).reshape(-1, 3)
