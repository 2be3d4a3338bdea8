"""The reconstruction's sparse points, moved by the alignment without being sent again."""

from __future__ import annotations

import numpy as np
import viser

from gazeloc_app.palette import POINTS
from gazeloc_app.scene.placing import place
from gazeloc_core.arrays import Bytes, Floats, Ints
from gazeloc_core.surfaces.even_sample import even_sample
from gazeloc_core.surfaces.glb import Rgb
from gazeloc_core.transforms import Similarity

MAX_POINTS = 200_000
"""Points that a browser without a graphics card draws some times a second."""


class CloudLayer:
    """Points (P, 3) in the frame `sfm` at `/sfm/cloud`; the node carries `scan_from_sfm`.

    Of more than `MAX_POINTS` an even sample is drawn; `drawn` says how many.
    """

    def __init__(self, scene: viser.SceneApi, name: str = "/sfm/cloud", point_size_m: float = 0.012):
        self._scene = scene
        self._name = name
        self._point_size_m = point_size_m
        self._shown: tuple[Floats | None, Bytes | None, Rgb | None] = (None, None, None)
        self._rows: Ints = np.zeros(0, dtype=np.int64)
        self._scan_from_sfm = Similarity.identity()
        self._handle: viser.PointCloudHandle | None = None
        self._visible = True
        self.drawn = 0

    def show(self, points_in_sfm: Floats | None, colors: Bytes | None, tint: Rgb | None = None) -> None:
        """Draw these points in their colours (P, 3), or all in one `tint`; None draws none."""
        before, self._shown = self._shown, (points_in_sfm, colors, tint)
        if before[0] is points_in_sfm and before[1] is colors and before[2] == tint:
            return
        if self._handle is not None:
            self._handle.remove()
            self._handle = None
        self.drawn = 0
        if points_in_sfm is None or len(points_in_sfm) == 0:
            return
        if before[0] is not points_in_sfm:
            rows = even_sample(points_in_sfm, MAX_POINTS)
            self._rows = np.random.default_rng(0).permutation(rows)  # static/page/detail.js draws a part while moving
        self.drawn = len(self._rows)
        self._handle = self._scene.add_point_cloud(
            self._name,
            np.asarray(points_in_sfm[self._rows], dtype=np.float32),
            np.array(colors[self._rows] if tint is None and colors is not None else tint or POINTS, np.uint8),
            point_size=self._point_size_m / self._scan_from_sfm.scale,
            point_shape="circle",
            point_shading="flat",
            precision="float32",
            visible=self._visible,
        )
        place(self._handle, self._scan_from_sfm)

    def align(self, scan_from_sfm: Similarity) -> None:
        """Move the points to where this alignment puts them."""
        if scan_from_sfm is self._scan_from_sfm:
            return
        self._scan_from_sfm = scan_from_sfm
        if self._handle is not None:
            place(self._handle, scan_from_sfm)
            self._handle.point_size = self._point_size_m / scan_from_sfm.scale

    def set_visible(self, visible: bool) -> None:
        """Show or hide the layer."""
        self._visible = visible
        if self._handle is not None:
            self._handle.visible = visible
