"""Clicked keypoints on both sides, and how far apart the alignment leaves each pair."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import viser

from gazeloc_app.actions.picks import Side
from gazeloc_app.palette import DISABLED, RESIDUAL, SCAN_SIDE, SELECTED, SFM_SIDE
from gazeloc_app.scene.placing import NodeGroup
from gazeloc_core.keypoints import KeypointPair, KeypointSet, Point
from gazeloc_core.surfaces.glb import Rgb
from gazeloc_core.transforms import Similarity


@dataclass(frozen=True)
class _Marker:
    position: Point
    color: Rgb
    radius_m: float


@dataclass(frozen=True)
class _Label:
    position: Point
    text: str


@dataclass(frozen=True)
class _Residual:
    start: Point
    end: Point
    color: Rgb


OnDrag = Callable[[Side, str, Any], None]


class KeypointsLayer:
    """Markers at `/keypoints/<key>/scan` and `/sfm`, the name as a label, and a line between a pair's two sides."""

    def __init__(self, scene: viser.SceneApi, radius_m: float = 0.025, on_drag: OnDrag | None = None):
        """`on_drag(side, key, event)` hears of drags of the markers, in order."""
        self._scene = scene
        self._on_drag = on_drag
        self._radius_m = radius_m
        self.size = 1.0
        """By what the markers' size is multiplied from now on (`sizes.size_factor`)."""
        self._markers: NodeGroup[_Marker] = NodeGroup(self._make_marker)
        self._labels: NodeGroup[_Label] = NodeGroup(self._make_label)
        self._residuals: NodeGroup[_Residual] = NodeGroup(self._make_residual)

    def show(self, pairs: KeypointSet, scan_from_sfm: Similarity | None, selected: str | None = None) -> None:
        """Draw the pairs, the sfm side where `scan_from_sfm` puts it (not at all while that is None)."""
        markers: dict[str, _Marker] = {}
        labels: dict[str, _Label] = {}
        residuals: dict[str, _Residual] = {}
        for pair in pairs:
            base = f"/keypoints/{pair.key}"
            sides = {"scan": pair.scan, "sfm": _moved(pair.sfm, scan_from_sfm)}
            drawn = {side: point for side, point in sides.items() if point is not None}
            for side, point in drawn.items():
                is_selected = pair.key == selected
                markers[f"{base}/{side}"] = _Marker(
                    point, _color(pair, side, is_selected), self.size * self._radius_m * (1.4 if is_selected else 1.0)
                )
            if drawn:
                labels[f"{base}/label"] = _Label(next(iter(drawn.values())), pair.name)
            if len(drawn) == 2:
                color = SELECTED if pair.key == selected else RESIDUAL if pair.enabled else DISABLED
                residuals[f"{base}/residual"] = _Residual(drawn["scan"], drawn["sfm"], color)
        self._markers.show(markers)
        self._labels.show(labels)
        self._residuals.show(residuals)

    def set_visible(self, visible: bool) -> None:
        """Show or hide the layer."""
        for group in (self._markers, self._labels, self._residuals):
            group.set_visible(visible)

    def _make_marker(self, name: str, marker: _Marker) -> viser.IcosphereHandle:
        handle = self._scene.add_icosphere(
            name,
            radius=marker.radius_m,
            color=marker.color,
            subdivisions=2,
            position=np.array(marker.position),
            cast_shadow=False,
            receive_shadow=False,
        )
        if self._on_drag is not None:
            _, _, key, side = name.split("/")
            self._hear_drags(handle, Side(side), key, self._on_drag)
        return handle

    @staticmethod
    def _hear_drags(handle: viser.IcosphereHandle, side: Side, key: str, on_drag: OnDrag) -> None:
        async def dragged(event: Any) -> None:
            on_drag(side, key, event)

        handler: Any = dragged  # viser takes coroutines too, which its annotation does not say
        handle.on_drag("left")(handler)

    def _make_label(self, name: str, label: _Label) -> viser.LabelHandle:
        return self._scene.add_label(name, label.text, position=np.array(label.position), anchor="bottom-left")

    def _make_residual(self, name: str, line: _Residual) -> viser.LineSegmentsHandle:
        return self._scene.add_line_segments(
            name, np.array([[line.start, line.end]]), np.array(line.color), thickness=3.0, thickness_units="screen"
        )


def _moved(point: Point | None, scan_from_sfm: Similarity | None) -> Point | None:
    if point is None or scan_from_sfm is None:
        return None
    x, y, z = scan_from_sfm.apply(point).tolist()
    return x, y, z


def _color(pair: KeypointPair, side: str, is_selected: bool) -> Rgb:
    if is_selected:
        return SELECTED
    if not pair.enabled:
        return DISABLED
    return SCAN_SIDE if side == "scan" else SFM_SIDE
