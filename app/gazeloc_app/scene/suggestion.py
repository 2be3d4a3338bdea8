"""The ghost of a keypoint: where it would help to click next."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import viser

from gazeloc_app.palette import SELECTED
from gazeloc_core.keypoints import Point

RADIUS_M = 0.05


class SuggestionLayer:
    """A see-through ball at `/suggestion`, larger than a keypoint's, with a word beside it."""

    def __init__(self, scene: viser.SceneApi, size: Callable[[], float] = lambda: 1.0):
        """`size()` multiplies the ball's size (`sizes.size_factor`)."""
        self._scene, self._size = scene, size
        self._handles: tuple[viser.IcosphereHandle, viser.LabelHandle] | None = None
        self._shown: Point | None = None

    def show(self, in_scan: Point | None) -> None:
        """Draw it at a place in the frame `scan`; None for none."""
        if in_scan == self._shown:
            return
        self._shown = in_scan
        if self._handles is not None and in_scan is None:
            for handle in self._handles:
                handle.remove()
            self._handles = None
        if in_scan is not None:
            at = np.array(in_scan)
            ball = self._scene.add_icosphere(
                "/suggestion/ball",
                radius=self._size() * RADIUS_M,
                color=SELECTED,
                opacity=0.4,
                subdivisions=3,
                position=at,
                cast_shadow=False,
                receive_shadow=False,
            )
            self._handles = (ball, self._scene.add_label("/suggestion/label", "next?", position=at))
