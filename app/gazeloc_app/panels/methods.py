"""Panel: the methods against each other, in a table, in the scene, and in renders of the frame that is shown."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from viser import GuiApi

from gazeloc_app import widgets
from gazeloc_app.actions.action import Action
from gazeloc_app.actions.choices import ChooseMethod, CompareMethod
from gazeloc_app.actions.jobs import StartJob
from gazeloc_app.data import ProjectData
from gazeloc_app.drawing.pictures import render_url
from gazeloc_app.palette import hexadecimal
from gazeloc_app.state import AppState
from gazeloc_app.work import tasks
from gazeloc_core.methods import Method
from gazeloc_core.trajectory import Trajectory

_COLUMNS = (
    "Frames: those that were localised. Mean error: of these, against the ground truth. "
    "Apart: the median distance from the poses of the method above."
)
_NO_TRUTH = "This recording has no ground truth, so no errors."


class MethodPanel:
    """Which method is shown and exported, which are compared with it, and how they differ."""

    def __init__(self, gui: GuiApi, data: ProjectData, dispatch: Callable[[Action], None]):
        self._data = data
        self._dispatch = dispatch
        self._state: AppState | None = None
        self._seen: object = None
        self._seen_renders: object = None
        self._chosen = gui.add_dropdown(
            "Method", tuple(Method), hint="Whose poses are red in the scene, rendered, and exported."
        )
        self._summary = gui.add_html("")
        self._run = gui.add_button("Run this method", hint="Every stage of it that is to do or outdated.")
        self._table = gui.add_html("")
        with gui.add_folder("Show beside it"):
            self._boxes = {method: gui.add_checkbox(method.value, False, hint=method.summary) for method in Method}
        self._renders = gui.add_html("")
        widgets.on_user(self._chosen, lambda event: self._choose(str(event.target.value)))
        widgets.on_user(self._run, lambda _: self._start(), event="on_click")
        for method, box in self._boxes.items():
            widgets.on_user(box, partial(_compare, dispatch, method))

    def render(self, state: AppState) -> None:
        """Show the state's methods."""
        self._state = state
        widgets.set_property(self._run, "disabled", state.has_job(f"Run {state.annotation.method}"))
        seen = (
            state.recording,
            state.annotation.method,
            state.annotation.alignment,
            state.data_revision,
            state.cameras,
        )
        if seen != self._seen:
            self._seen = seen
            method = state.annotation.method
            widgets.set_value(self._chosen, method.value)
            widgets.set_content(self._summary, widgets.box(widgets.text(method.summary)))
            widgets.set_content(self._table, widgets.box(self._table_html(state)))
        for method, box in self._boxes.items():
            widgets.set_value(box, method in state.layers.compared)
        self._render_pictures(state, seen)

    def _table_html(self, state: AppState) -> str:
        shown = self._trajectory(state, state.annotation.method)
        rows = []
        for method in Method:
            trajectory = self._trajectory(state, method)
            color = state.cameras.estimate if method is state.annotation.method else state.cameras.methods[method]
            name = widgets.colored("■", hexadecimal(color)) + f" {widgets.text(method.value)}"
            name = f'<span title="{widgets.text(method.summary)}">{name}</span>'
            if trajectory is None:
                rows.append([name, widgets.colored("not run", widgets.MUTED), "", ""])
            else:
                rows.append([name, *self._cells(state, method, trajectory, shown)])
        has_truth = self._data.truth(state.recording) is not None
        note = widgets.colored(_COLUMNS if has_truth else f"{_NO_TRUTH} {_COLUMNS}", widgets.MUTED)
        return widgets.html_table(["Method", "Frames", "Mean error", "Apart"], rows) + note

    def _cells(
        self, state: AppState, method: Method, trajectory: Trajectory, shown: Trajectory | None
    ) -> tuple[str, str, str]:
        """Frames localised, mean errors of these against the truth, and the median distance from the shown poses."""
        is_localised = trajectory.is_localised
        errors = self._data.errors(state.recording, self._data.poses_key(state.recording, state.annotation, method))
        error = apart = "–"
        if errors is not None and is_localised.any():
            position, degrees = _mean(errors.position_m[is_localised]), _mean(errors.rotation_deg[is_localised])
            error = widgets.centimetres(position) + ("" if degrees is None else f", {degrees:.2f}°")
        if shown is not None and shown is not trajectory:
            both = is_localised & shown.has_pose
            if both.any():
                distance = np.linalg.norm(trajectory.centers[both] - shown.centers[both], axis=1)
                apart = widgets.centimetres(float(np.median(distance)))
        return f"{int(is_localised.sum())} of {len(trajectory)}", error, apart

    def _render_pictures(self, state: AppState, seen: object) -> None:
        key = (seen, state.frame, state.layers.compared)
        if key == self._seen_renders:
            return
        self._seen_renders = key
        methods = [
            state.annotation.method,
            *(m for m in Method if m in state.layers.compared - {state.annotation.method}),
        ]
        pictures = "".join(self._picture(state, method) for method in methods) if state.layers.compared else ""
        widgets.set_content(self._renders, widgets.box(pictures) if pictures else "")

    def _picture(self, state: AppState, method: Method) -> str:
        key = self._data.poses_key(state.recording, state.annotation, method)
        trajectory = self._data.trajectory(state.recording, key)
        has_pose = trajectory is not None and state.frame < len(trajectory) and trajectory.pose(state.frame) is not None
        caption = widgets.text(method.value) + ("" if has_pose else ": no pose")
        url = render_url(self._data, state.recording, key or "", state.frame)
        picture = f'<img alt="{widgets.text(method)}" src="{widgets.text(url)}" style="width:100%">' if has_pose else ""
        return f'<div style="display:inline-block;width:49%;vertical-align:top;margin:1px">{caption}<br>{picture}</div>'

    def _trajectory(self, state: AppState, method: Method) -> Trajectory | None:
        return self._data.trajectory(state.recording, self._data.poses_key(state.recording, state.annotation, method))

    def _choose(self, name: str) -> None:
        if name in tuple(Method):
            self._dispatch(ChooseMethod(Method(name)))

    def _start(self) -> None:
        if self._state is not None:
            method = self._state.annotation.method
            keywords = (("recording", self._state.recording), ("method", method))
            self._dispatch(StartJob(f"Run {method}", tasks.run_all, keywords))


def _compare(dispatch: Callable[[Action], None], method: Method, event: Any) -> None:
    dispatch(CompareMethod(method, bool(event.target.value)))


def _mean(values: Any) -> float | None:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else None
