"""Panel: one frame of the recording against the render of the scan from its estimated pose, and the way through all.

How frame and render lie on each other is the page's own (comparison.py); everything else is the same in all browsers.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from viser import GuiApi

from gazeloc_app import widgets
from gazeloc_app.actions.action import Action
from gazeloc_app.actions.views import CompareWith, DrawTags
from gazeloc_app.data import ProjectData
from gazeloc_app.frames.offset_text import offset_text
from gazeloc_app.frames.sightings import image_of_frame
from gazeloc_app.frames.support_text import tag_support_text, track_support_text
from gazeloc_app.frames.timeline_html import MARK_SIGNS, timeline_html
from gazeloc_app.panels.comparison import ComparisonHtml
from gazeloc_app.panels.marks import MarkWidgets
from gazeloc_app.panels.meanwhile import meanwhile
from gazeloc_app.panels.playing import PlayWidgets
from gazeloc_app.panels.scrubber import Scrubber
from gazeloc_app.state import AppState, Layer
from gazeloc_core.methods import Method
from gazeloc_core.trajectory import PoseStatus

NOTHING = "nothing"
STATUS_TEXT = {
    PoseStatus.REGISTERED.value: "registered",
    PoseStatus.TRACKED.value: "tracked between keyframes",
    PoseStatus.INTERPOLATED.value: "interpolated, not measured",
    PoseStatus.TAG_ONLY.value: "from a tag alone",
    PoseStatus.REJECTED.value: "rejected: no pose",
    PoseStatus.NONE.value: "not localised: no pose",
}


class FramePanel:
    """The comparison, the timeline, marks, and what is known about the frame."""

    def __init__(
        self,
        gui: GuiApi,
        template: Path,
        data: ProjectData,
        dispatch: Callable[[Action], None],
        look_through: Callable[[int, int], None],
    ):
        """`look_through(client_id, frame)` puts one browser's camera where the frame's camera was."""
        self._data, self._dispatch, self._look_through = data, dispatch, look_through
        self._state: AppState | None = None
        self._seen: object = None
        self._seen_timeline: object = None
        self._others: dict[str, str] = {NOTHING: ""}
        self._comparison = ComparisonHtml(gui, template, data)
        self._scrubber = Scrubber(gui)
        self._timeline = gui.add_html("")
        self._facts = gui.add_html("")
        self._marks = MarkWidgets(gui, dispatch)
        self._playing = PlayWidgets(gui, data, dispatch)
        self._look = gui.add_button(
            "Look through this camera",
            hint="In this browser. It follows the frame, also while it plays. In frames of the reconstruction, "
            "keyframes that is, clicks can then make keypoints.",
        )
        self._tags = gui.add_checkbox(
            "Draw tags", False, hint="Outline, id, axes and a cube of each tag that was found in the frame."
        )
        self._other = gui.add_dropdown(
            "B, for A | B", (NOTHING,), hint="The render from another method's poses or another alignment, below A's."
        )
        widgets.on_user(self._tags, lambda event: dispatch(DrawTags(bool(event.target.value))))
        widgets.on_user(self._look, lambda event: look_through(event.client_id, self._frame()), event="on_click")
        widgets.on_user(self._other, lambda event: self._compare_with(str(event.target.value)))

    def render(self, state: AppState) -> None:
        """Show the state's frame."""
        self._state = state
        self._marks.render(state)
        self._playing.render(state)
        key = self._data.poses_key(state.recording, state.annotation)
        keypoints = (state.annotation.keypoints, state.selected_key, state.layers.is_visible(Layer.KEYPOINTS))
        found = (state.recording, key, state.data_revision, state.annotation.marks, state.annotation.compared_with)
        if found != self._seen_timeline:
            self._seen_timeline = found
            self._render_timeline(state, key)
            self._render_others(state)
        seen = (found, keypoints, state.frame, state.renderer_note, state.layers.draws_tags, meanwhile(state))
        if seen == self._seen:
            return
        self._seen = seen
        last = len(self._data.recording(state.recording)) - 1
        self._scrubber.show(last)
        frame = min(state.frame, last)
        trajectory = self._data.trajectory(state.recording, key)
        status = PoseStatus.NONE.value if trajectory is None else str(trajectory.status[frame])
        has_pose = PoseStatus(status).has_pose
        widgets.set_value(self._tags, state.layers.draws_tags)
        is_anywhere = has_pose or image_of_frame(self._data, state.recording, frame) is not None
        widgets.set_property(self._look, "disabled", not is_anywhere)
        self._comparison.show(state, frame, self._other_poses(state))
        widgets.set_content(self._facts, widgets.box(self._facts_html(state, frame, status)))

    def _facts_html(self, state: AppState, frame: int, status: str) -> str:
        times = self._data.recording(state.recording).timestamp_ns
        seconds = (int(times[frame]) - int(times[0])) / 1e9
        facts = [f"Frame {frame} of {len(times)} · {seconds:.2f} s · {STATUS_TEXT[status]}"]
        facts.append(tag_support_text(self._data.tag_columns(state.recording, state.annotation.method), frame))
        if status == PoseStatus.TRACKED.value:
            facts.append(track_support_text(self._data.tracked(state.recording), frame))
        facts += [self._score_text(state, frame), self._error_text(state, frame), state.renderer_note]
        lines = [widgets.text(fact) for fact in facts if fact]
        mark = state.annotation.marks.get(frame)
        if mark is not None:
            lines.append(widgets.colored(f"{MARK_SIGNS[mark.mark]} marked {mark.mark}", widgets.MARK_COLORS[mark.mark]))
        return f'<div class="gazeloc-facts">{"<br>".join(lines)}</div>'

    def _score_text(self, state: AppState, frame: int) -> str:
        found = self._data.frame_scores(state.recording, self._data.poses_key(state.recording, state.annotation))
        if found is None or not np.isfinite(found.score[frame]):
            return ""
        return f"Agreement with the scan: {found.score[frame]:.2f}. {offset_text(found, frame)}"

    def _error_text(self, state: AppState, frame: int) -> str:
        if self._data.truth(state.recording) is None:
            return "This recording has no ground truth, so there are no errors to show."
        errors = self._data.errors(state.recording, self._data.poses_key(state.recording, state.annotation))
        if errors is None or not np.isfinite(errors.position_m[frame]):
            return ""
        return f"Against the ground truth: {100 * errors.position_m[frame]:.1f} cm, {errors.rotation_deg[frame]:.2f}°"

    def _render_timeline(self, state: AppState, key: str | None) -> None:
        errors = self._data.errors(state.recording, key)
        content = timeline_html(
            self._data.trajectory(state.recording, key),
            self._data.scores(state.recording, key),
            None if errors is None else errors.position_m,
            state.annotation.marks,
        )
        widgets.set_content(self._timeline, content)

    def _render_others(self, state: AppState) -> None:
        alignments = {f"sfm, {one.method} {one.key}": one.key for one in self._data.alignments(state.recording)}
        methods = {
            method.value: method.value
            for method in Method
            if method is not Method.SFM and self._data.poses_key(state.recording, state.annotation, method)
        }
        self._others = {NOTHING: ""} | methods | alignments
        if tuple(self._other.options) != tuple(self._others):
            self._other.options = tuple(self._others)
        label = next((name for name, poses in self._others.items() if poses == state.annotation.compared_with), NOTHING)
        widgets.set_value(self._other, label)

    def _other_poses(self, state: AppState) -> tuple[str, str | None] | None:
        """What B is, for people, and its key; None for nothing, or where it is gone."""
        poses = state.annotation.compared_with
        if not poses or poses not in self._others.values():
            return None
        if poses in tuple(Method):
            return poses, self._data.poses_key(state.recording, state.annotation, Method(poses))
        return f"sfm {poses}", poses

    def _compare_with(self, label: str) -> None:
        if label in self._others:
            self._dispatch(CompareWith(self._others[label]))

    def _frame(self) -> int:
        return 0 if self._state is None else self._state.frame
