"""A recording often begins before its first pose: start where there is something to compare."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gazeloc_app.actions.action import Action
from gazeloc_app.actions.views import BeginAt
from gazeloc_app.data import ProjectData
from gazeloc_app.state import AppState


class FirstPose:
    """An effect of the store."""

    def __init__(self, data: ProjectData, dispatch: Callable[[Action], None]):
        self._data, self._dispatch = data, dispatch

    def __call__(self, before: AppState, after: AppState) -> None:
        """Go to the first frame with a pose where the poses that are shown have changed and nobody has moved on."""
        shown = [(state.recording, state.annotation.alignment, state.annotation.method) for state in (before, after)]
        if shown[0] != shown[1] and after.frame == 0:
            self.show(after)

    def show(self, state: AppState) -> None:
        """Go there."""
        trajectory = self._data.trajectory(state.recording, self._data.poses_key(state.recording, state.annotation))
        if trajectory is not None and trajectory.is_localised.any():
            self._dispatch(BeginAt(int(np.flatnonzero(trajectory.is_localised)[0])))
