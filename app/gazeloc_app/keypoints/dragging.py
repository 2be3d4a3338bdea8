"""Keypoints dragged in the scene: the marker follows the pointer, and where it is let go counts.

On the scan's side it slides along the surface. On the reconstruction's it moves in the plane that faces the camera, and
where it is let go near a point of the cloud it takes that point, as a click there does.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from gazeloc_app.actions.action import Action, Notify
from gazeloc_app.actions.picks import MovePoint, Side
from gazeloc_app.data import ProjectData
from gazeloc_app.keypoints.moving import dragged
from gazeloc_app.keypoints.picking import pick_cloud, tolerance_rad
from gazeloc_app.scene.kept import EVERYTHING, Kept
from gazeloc_app.state import Level
from gazeloc_core.arrays import Floats
from gazeloc_core.keypoints import Point
from gazeloc_core.sfm_model import SfmModel
from gazeloc_core.transforms import Similarity


@dataclass(frozen=True, eq=False)
class Cloud:
    """The reconstruction as it is drawn."""

    model: SfmModel
    scan_from_sfm: Similarity


class Dragging:
    """Hears of drags; each is one action, when it ends, so one undo takes it back."""

    def __init__(
        self,
        data: ProjectData,
        front: Callable[[], int],
        dispatch: Callable[[Action], None],
        kept: Callable[[int], Kept] = lambda _: EVERYTHING,
    ):
        """`kept(client_id)` is what that browser's cuts leave of the room: a marker beyond them is not in its hand."""
        self._data, self._front, self._dispatch, self._kept = data, front, dispatch, kept
        self.cloud: Cloud | None = None
        """Whose points markers of the reconstruction's side snap to; None while there is none."""
        self._from: dict[tuple[Side, str], Point] = {}
        self._at: dict[tuple[Side, str], Point] = {}

    def __call__(self, side: Side, key: str, event: Any) -> None:
        """A drag of the marker of a keypoint on one side began, went on or ended."""
        marker, dragged_one, kept = event.target, (side, key), self._kept(event.client.client_id)
        if event.phase == "start":
            self._at.pop(dragged_one, None)
            if kept.has(marker.position):
                self._from[dragged_one] = _point(np.asarray(marker.position))
        if dragged_one not in self._from:
            return
        eye, pointer = np.asarray(event.client.camera.position), np.asarray(event.end_position)
        if side is Side.SCAN:
            point = dragged(self._data.raycaster(), eye, pointer, self._front(), kept)
        else:
            point = _point(pointer) if np.isfinite(pointer).all() else None
        if point is not None and event.phase != "start":
            self._at[dragged_one] = point
            marker.position = np.array(point)
        if event.phase == "end":
            self._end(side, key, event)

    def _end(self, side: Side, key: str, event: Any) -> None:
        began, at = self._from.pop((side, key)), self._at.pop((side, key), None)
        if at is not None and side is Side.SCAN:
            self._dispatch(MovePoint(key, at))
        elif at is not None and self.cloud is not None:
            kept = self._kept(event.client.client_id)
            self._dispatch(MovePoint(key, _in_reconstruction(self.cloud, at, event.client.camera, kept), Side.SFM))
        else:
            event.target.position = np.array(began)
            self._dispatch(Notify(Level.INFO, "There is no scan under the pointer; the keypoint stays where it was."))


def _in_reconstruction(cloud: Cloud, at: Point, camera: Any, kept: Kept) -> Point:
    """The point of the cloud under the pointer, else the place itself, in the frame `sfm`."""
    eye, place = np.asarray(camera.position), np.array(at)
    tolerance = tolerance_rad(float(camera.fov), max(int(camera.image_height), 1))
    found = pick_cloud(cloud.scan_from_sfm.apply(cloud.model.points), eye, place - eye, tolerance, kept)
    return _point(cloud.scan_from_sfm.inverse().apply(place) if found is None else cloud.model.points[found])


def _point(values: Floats) -> Point:
    x, y, z = (float(value) for value in values)
    return x, y, z
