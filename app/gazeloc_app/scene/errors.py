"""How far the estimates are from the truth: a line from each estimated camera centre to the true one."""

from __future__ import annotations

import numpy as np
import viser

from gazeloc_core.arrays import Bytes, Floats
from gazeloc_core.surfaces.glb import lines_glb


class ErrorsLayer:
    """Lines at `/errors`, one node for all."""

    def __init__(self, scene: viser.SceneApi):
        self._scene = scene
        self._handle: viser.GlbHandle | None = None
        self._visible = True

    def show(self, segments: Floats | None, colors: Bytes | None) -> None:
        """Draw lines (K, 2, 3) in the frame `scan` with sRGB colours (K, 3) instead; None draws none."""
        if segments is None or colors is None or len(segments) == 0:
            if self._handle is not None:
                self._handle.remove()
                self._handle = None
            return
        ends = np.repeat(colors[:, None], 2, axis=1)
        glb = lines_glb(segments, ends).to_bytes()
        self._handle = self._scene.add_glb(
            "/errors", glb, cast_shadow=False, receive_shadow=False, visible=self._visible
        )

    def set_visible(self, visible: bool) -> None:
        """Show or hide the layer."""
        self._visible = visible
        if self._handle is not None:
            self._handle.visible = visible
