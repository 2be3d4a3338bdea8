"""Keypoints dragged along the scan's surface: the marker follows the pointer, and where it is let go counts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from gazeloc_app.actions.action import Action, Notify
from gazeloc_app.actions.picks import MovePoint
from gazeloc_app.data import ProjectData
from gazeloc_app.moving import dragged
from gazeloc_app.state import Level
from gazeloc_core.keypoints import Point


class Dragging:
    """Hears of drags; each is one action, when it ends, so one undo takes it back."""

    def __init__(self, data: ProjectData, front: Callable[[], int], dispatch: Callable[[Action], None]):
        self._data, self._front, self._dispatch = data, front, dispatch
        self._from: dict[str, Point] = {}
        self._at: dict[str, Point] = {}

    def __call__(self, key: str, event: Any) -> None:
        """A drag of the marker of a keypoint began, went on or ended."""
        marker = event.target
        if event.phase == "start":
            self._from[key] = tuple(np.asarray(marker.position, dtype=np.float64).tolist())
            self._at.pop(key, None)
        eye, pointer = np.asarray(event.client.camera.position), np.asarray(event.end_position)
        point = dragged(self._data.raycaster(), eye, pointer, self._front())
        if point is not None and event.phase != "start":
            self._at[key] = point
            marker.position = np.array(point)
        if event.phase == "end":
            self._end(key, marker)

    def _end(self, key: str, marker: Any) -> None:
        began, at = self._from.pop(key, None), self._at.pop(key, None)
        if at is not None:
            self._dispatch(MovePoint(key, at))
        elif began is not None:
            marker.position = np.array(began)
            self._dispatch(Notify(Level.INFO, "There is no scan under the pointer; the keypoint stays where it was."))
