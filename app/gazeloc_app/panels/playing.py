"""Widgets: playing the recording, stepping through it, and going from one problem to the next."""

from __future__ import annotations

from collections.abc import Callable

from viser import GuiApi

from gazeloc_app import widgets
from gazeloc_app.actions.action import Action, Notify
from gazeloc_app.actions.playing import SPEEDS, SetSpeed, TogglePlay
from gazeloc_app.actions.views import ShowFrame, StepFrame
from gazeloc_app.data import ProjectData
from gazeloc_app.frames.problems import FrameTable, frame_table, next_problem
from gazeloc_app.state import AppState, Level

_STEPS = ("◀", "▶", "◀ keyframe", "keyframe ▶")
_PROBLEMS = ("◀ problem", "problem ▶")
_SPEED_NAMES = {f"{speed:g}×": speed for speed in SPEEDS}


class PlayWidgets:
    """Play, speed, steps, problems; each with its key."""

    def __init__(self, gui: GuiApi, data: ProjectData, dispatch: Callable[[Action], None]):
        self._data, self._dispatch = data, dispatch
        self._state: AppState | None = None
        self._play = gui.add_button("▶ Play", hint="The space bar. All browsers see the frame go on.")
        self._speed = gui.add_dropdown(
            "Speed", tuple(_SPEED_NAMES), initial_value="1×", hint="Of playing, against real time."
        )
        steps = gui.add_button_group("", _STEPS, hint="The keys J and L go one frame back and on.")
        problems = gui.add_button_group(
            "", _PROBLEMS, hint="No pose, a low score, or marked bad or unsure. The key N goes to the next."
        )
        widgets.on_user(self._play, lambda _: dispatch(TogglePlay()), event="on_click")
        widgets.on_user(self._speed, lambda event: self._set_speed(str(event.target.value)))
        widgets.on_user(steps, lambda event: self._step(str(event.target.value)), event="on_click")
        widgets.on_user(problems, lambda event: self._to_problem(str(event.target.value)), event="on_click")
        toggle = gui.add_command("Play or stop", hotkey="space")
        widgets.on_user(toggle, lambda _: dispatch(TogglePlay()), event="on_trigger")
        back = gui.add_command("One frame back", hotkey="J")
        widgets.on_user(back, lambda _: self._step(_STEPS[0]), event="on_trigger")
        ahead = gui.add_command("One frame on", hotkey="L")
        widgets.on_user(ahead, lambda _: self._step(_STEPS[1]), event="on_trigger")
        problem = gui.add_command("Next problem", hotkey="N", description="No pose, low score, marked bad or unsure")
        widgets.on_user(problem, lambda _: self._to_problem(_PROBLEMS[1]), event="on_trigger")

    def render(self, state: AppState) -> None:
        """Show whether it plays, and how fast."""
        self._state = state
        widgets.set_property(self._play, "label", "■ Stop" if state.is_playing else "▶ Play")
        widgets.set_value(self._speed, f"{state.speed:g}×")

    def _set_speed(self, name: str) -> None:
        if name in _SPEED_NAMES:
            self._dispatch(SetSpeed(_SPEED_NAMES[name]))

    def _step(self, which: str) -> None:
        state = self._state
        if state is None or which not in _STEPS:
            return
        frame, keyframes = state.frame, self._data.keyframes(state.recording)
        if "keyframe" in which and keyframes is not None and len(keyframes):
            later, earlier = keyframes[keyframes > frame], keyframes[keyframes < frame]
            target = (later[0] if len(later) else frame) if "▶" in which else (earlier[-1] if len(earlier) else frame)
            self._dispatch(ShowFrame(int(target)))
        else:
            last = len(self._data.recording(state.recording)) - 1
            self._dispatch(StepFrame(1 if "▶" in which else -1, last))

    def _to_problem(self, which: str) -> None:
        if self._state is None or which not in _PROBLEMS:
            return
        target = next_problem(table_of(self._data, self._state), self._state.frame, 1 if "▶" in which else -1)
        if target is None:
            self._dispatch(
                Notify(Level.INFO, "No frame has a problem: each has a pose, none a low score or a bad mark.")
            )
        else:
            self._dispatch(ShowFrame(target))


def table_of(data: ProjectData, state: AppState) -> FrameTable:
    """What is known about the frames by the poses that are shown."""
    key = data.poses_key(state.recording, state.annotation)
    trajectory, score = data.trajectory(state.recording, key), data.scores(state.recording, key)
    return frame_table(len(score), trajectory, score, state.annotation.marks)
