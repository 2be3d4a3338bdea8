"""Cutting the room open, for one browser: what lies beyond the sliders is neither drawn nor clicked nor dragged.

Each cutting plane is an invisible node `/cut/<n>` of that browser's scene, whose z axis points to what is cut away;
static/page/cut.js applies them to everything that stands in the room.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import viser
from scipy.spatial.transform import Rotation

from gazeloc_app import widgets
from gazeloc_app.scene.kept import EVERYTHING, Kept, Plane
from gazeloc_app.scene.placing import NodeGroup
from gazeloc_core.arrays import Floats
from gazeloc_core.surfaces.viewpoint import up_vector


class Cut:
    """The sliders of one browser, and its planes. Ends of a slider cut nothing."""

    def __init__(self, client: viser.ClientHandle, low: Floats, high: Floats, up_axis: str):
        """`low` and `high` (3,) are the room's corners in the frame `scan`."""
        self.kept = EVERYTHING
        self._client = client
        self._nodes: NodeGroup[Plane] = NodeGroup(self._make_node)
        up = up_vector(up_axis)
        self._axes = [up, *(np.eye(3)[axis] for axis in range(3) if up[axis] == 0)]
        self._sliders: list[Any] = []
        with client.gui.add_folder("Cut the room open", expand_by_default=False):
            for axis, label in zip(self._axes, _labels(up_axis), strict=True):
                ends = sorted((float(axis @ low), float(axis @ high)))
                size = round(max(ends[1] - ends[0], 0.02), 2)
                slider = client.gui.add_multi_slider(
                    label, 0.0, size, 0.01, (0.0, size), hint="Metres that are left; in this browser only."
                )
                self._sliders.append((slider, ends[0], size))
                widgets.on_user(slider, lambda _: self._changed())
            self._whole = client.gui.add_button(
                "Whole again", visible=False, color="gray", hint="Nothing is cut away any more."
            )
        widgets.on_user(self._whole, lambda _: self._undo(), event="on_click")

    def _changed(self) -> None:
        planes = tuple(
            plane
            for axis, (slider, start, size) in zip(self._axes, self._sliders, strict=True)
            for plane in _planes(axis, slider.value, start, size)
        )
        self.kept = Kept(planes)
        self._nodes.show({f"/cut/{number}": plane for number, plane in enumerate(planes)})
        widgets.set_property(self._whole, "visible", bool(planes))

    def _undo(self) -> None:
        for slider, _, size in self._sliders:
            slider.value = (0.0, size)
        self._changed()

    def _make_node(self, name: str, plane: Plane) -> viser.FrameHandle:
        wxyz = Rotation.align_vectors([plane.normal], [[0, 0, 1]])[0].as_quat(scalar_first=True)
        position = plane.offset * np.array(plane.normal)
        return self._client.scene.add_frame(name, show_axes=False, wxyz=wxyz, position=position)


def _planes(axis: Floats, value: Sequence[float], start: float, size: float) -> list[Plane]:
    """The planes that leave what is between two places along an axis; a browser may send them in any order."""
    low, high = sorted(min(max(float(place), 0.0), size) for place in value)
    x, y, z = axis.tolist()
    planes = [Plane((x, y, z), start + high)] if high < size - 0.005 else []
    return [*planes, Plane((-x, -y, -z), -(start + low))] if low > 0.005 else planes


def _labels(up_axis: str) -> list[str]:
    return ["Height, m", *(f"Along {axis}, m" for axis in "xyz" if axis != up_axis[-1])]
