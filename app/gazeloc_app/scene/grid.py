"""The ground in square metres, and which way is up."""

from __future__ import annotations

import numpy as np
import viser

from gazeloc_app.palette import AXES, GROUND
from gazeloc_core.arrays import Bytes, Floats
from gazeloc_core.surfaces.glb import lines_glb
from gazeloc_core.surfaces.viewpoint import up_vector

_ABOVE_FLOOR_M = 0.005
"""So that the lines are not half in the floor."""
_MOST_SQUARES = 100


class GridLayer:
    """Squares of one metre at the floor's height, and the scan's axes, 1 m each, where its origin meets the ground.

    In what is larger than a hall both are of 10 m, or of 100 m, so that there are never more than 100 squares in a row.

    The lines are at `/grid`, the axes' names at `/grid-x` to `/grid-z`, the one that is up with an arrow.
    """

    def __init__(self, scene: viser.SceneApi):
        self._scene = scene
        self._nodes: list[viser.SceneNodeHandle] = []
        self._visible = True

    def show(self, low: Floats, high: Floats, up_axis: str) -> None:
        """Draw it for a room between two corners (3,) in the frame `scan`."""
        segments, colors = grid_lines(low, high, up_axis)
        glb = lines_glb(segments, colors).to_bytes()
        nodes: list[viser.SceneNodeHandle] = [
            self._scene.add_glb("/grid", glb, cast_shadow=False, receive_shadow=False, visible=self._visible)
        ]
        for axis, end in zip("xyz", segments[-3:, 1], strict=True):
            text = f"{axis} ↑" if axis == up_axis[-1] and not up_axis.startswith("-") else axis
            text = f"{axis} ↓" if up_axis == f"-{axis}" else text
            nodes.append(self._scene.add_label(f"/grid-{axis}", text, position=end, visible=self._visible))
        self._nodes = nodes

    def set_visible(self, visible: bool) -> None:
        """Show or hide the layer."""
        self._visible = visible
        for node in self._nodes:
            node.visible = visible


def grid_lines(low: Floats, high: Floats, up_axis: str) -> tuple[Floats, Bytes]:
    """Lines (N, 2, 3) at whole metres (or tens) of the scan's axes, the last three its axes; and colours (N, 3)."""
    up = up_vector(up_axis)
    height = int(np.flatnonzero(up)[0])
    first, second = (axis for axis in range(3) if axis != height)
    floor = (low if up[height] > 0 else high)[height] + _ABOVE_FLOOR_M * up[height]
    step = 10.0 ** max(0, np.ceil(np.log10(max(float((high - low).max()), 1.0) / _MOST_SQUARES)))
    start, end = step * np.floor(low / step), step * np.ceil(high / step)
    lines = []
    for along, across in ((first, second), (second, first)):
        for place in np.arange(start[across], end[across] + 0.5 * step, step):
            ends = np.full((2, 3), floor)
            ends[:, across], ends[:, along] = place, (start[along], end[along])
            lines.append(ends)
    origin = np.clip(np.zeros(3), start, end)  # a scan's origin may lie outside of the room
    origin[height] = floor
    axes = np.stack([np.tile(origin, (3, 1)), origin + step * np.eye(3)], axis=1)
    colors = np.concatenate([np.tile(np.array(GROUND), (len(lines), 1)), AXES]).astype(np.uint8)
    return np.concatenate([lines, axes]), colors
