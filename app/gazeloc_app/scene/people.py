"""Where the other people look from, as one browser sees it: a small frustum and a name for each."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import viser

from gazeloc_app.palette import Rgb

Vector = tuple[float, float, float]
SIZE_M = 0.22
"""Depth of a frustum."""
MAX_ASPECT = 2.5


@dataclass(frozen=True)
class Onlooker:
    """Somebody else's camera in the scan; axes as OpenCV has them, `fov_rad` is the vertical field of view."""

    number: int
    title: str
    color: Rgb
    position: Vector
    wxyz: tuple[float, float, float, float]
    fov_rad: float
    aspect: float


class PeopleLayer:
    """Nodes `/people/<number>` of one browser's own scene. Only what changed is sent."""

    def __init__(self, scene: viser.SceneApi):
        self._scene = scene
        self._shown: dict[int, tuple[Onlooker, Any, Any]] = {}

    def show(self, onlookers: Iterable[Onlooker]) -> None:
        """Draw exactly these."""
        wanted = {one.number: one for one in onlookers}
        for number in [number for number in self._shown if number not in wanted]:
            _, *nodes = self._shown.pop(number)
            for node in nodes:
                node.remove()
        for number, one in wanted.items():
            known = self._shown.get(number)
            if known is None or not _differ_by_place_alone(known[0], one):
                self._shown[number] = self._made(one)
            elif known[0] != one:
                _, frustum, label = known
                frustum.position = label.position = np.array(one.position)
                frustum.wxyz = np.array(one.wxyz)
                self._shown[number] = (one, frustum, label)

    def _made(self, one: Onlooker) -> tuple[Onlooker, Any, Any]:
        frustum = self._scene.add_camera_frustum(
            f"/people/{one.number}",
            fov=one.fov_rad,
            aspect=min(one.aspect, MAX_ASPECT),
            scale=SIZE_M,
            thickness=2.0,
            thickness_units="screen",
            color=one.color,
            position=np.array(one.position),
            wxyz=np.array(one.wxyz),
            cast_shadow=False,
            receive_shadow=False,
        )
        label = self._scene.add_label(f"/people-names/{one.number}", one.title, position=np.array(one.position))
        return one, frustum, label


def _differ_by_place_alone(one: Onlooker, other: Onlooker) -> bool:
    return one == replace(other, position=one.position, wxyz=one.wxyz)
