"""Panel: one frame of the recording against the render of the scan from its estimated pose, with blend and wipe.

The pictures are URLs of our own routes (routes.py); blend and wipe are CSS in the page and cost the server nothing.
"""

from __future__ import annotations

import secrets
from collections.abc import Callable
from pathlib import Path
from urllib.parse import quote

import numpy as np
from viser import GuiApi

from gazeloc_app import widgets
from gazeloc_app.actions.action import Action
from gazeloc_app.actions.picks import Side
from gazeloc_app.actions.views import DrawTags, ShowFrame
from gazeloc_app.data import ProjectData
from gazeloc_app.frame_marks import marks_in_frame
from gazeloc_app.gaze_at import gaze_in_frame
from gazeloc_app.panels.marks_svg import marks_svg
from gazeloc_app.sightings import image_of_frame
from gazeloc_app.state import AppState, Layer
from gazeloc_core.camera import Camera
from gazeloc_core.trajectory import PoseStatus, Trajectory

STRIP_PARTS = 300
STATUS_TEXT = {
    PoseStatus.REGISTERED.value: "registered",
    PoseStatus.INTERPOLATED.value: "interpolated between registered frames",
    PoseStatus.TAG_ONLY.value: "from a tag alone",
    PoseStatus.REJECTED.value: "rejected: no pose",
    PoseStatus.NONE.value: "not localised: no pose",
}


class FramePanel:
    """The slider, the comparison, and what is known about the frame."""

    def __init__(
        self,
        gui: GuiApi,
        template: Path,
        data: ProjectData,
        dispatch: Callable[[Action], None],
        look_through: Callable[[int, int], None],
    ):
        """`look_through(client_id, frame)` puts one browser's camera where the frame's camera was."""
        self._gui = gui
        self._template = template.read_text(encoding="utf-8")
        self._data = data
        self._dispatch = dispatch
        self._look_through = look_through
        self._state: AppState | None = None
        self._seen: object = None
        self._revision = secrets.token_hex(4)  # the frames of this session; the browser may keep them
        self._before = ""
        self._strip_of: Trajectory | None = None
        self._comparison = gui.add_html("")
        self._slider = gui.add_slider("Frame", 0, 1, 1, 0)
        self._strip = gui.add_html("")
        self._steps = gui.add_button_group("", ("◀", "▶", "◀ keyframe", "keyframe ▶"))
        self._look = gui.add_button(
            "Look through this camera",
            hint="Of frames in the reconstruction, keyframes that is. Clicks in the frame can then make keypoints.",
        )
        self._tags = gui.add_checkbox(
            "Draw tags", False, hint="Outline, id, axes and a cube of each tag that was found in the frame."
        )
        self._facts = gui.add_html("")
        widgets.on_user(self._tags, lambda event: self._dispatch(DrawTags(bool(event.target.value))))
        widgets.on_user(self._slider, lambda event: self._show(int(event.target.value)))
        widgets.on_user(self._steps, lambda event: self._step(str(event.target.value)), event="on_click")
        widgets.on_user(self._look, lambda event: self._look_through(event.client_id, self._frame()), event="on_click")

    def render(self, state: AppState) -> None:
        """Show the state's frame."""
        self._state = state
        key = self._data.poses_key(state.recording, state.annotation)
        keypoints = (state.annotation.keypoints, state.selected_key, state.layers.is_visible(Layer.KEYPOINTS))
        shown = (state.recording, state.frame, key, state.data_revision, state.renderer_note, state.draws_tags)
        seen = (shown, keypoints)
        if seen == self._seen:
            return
        self._seen = seen
        recording = self._data.recording(state.recording)
        last = len(recording) - 1
        widgets.set_property(self._slider, "max", max(last, 1))
        frame = min(state.frame, last)
        widgets.set_value(self._slider, frame)
        trajectory = self._data.trajectory(state.recording, key)
        has_pose = trajectory is not None and trajectory.pose(frame) is not None
        widgets.set_value(self._tags, state.draws_tags)
        widgets.set_property(self._look, "disabled", image_of_frame(self._data, state.recording, frame) is None)
        widgets.set_content(self._comparison, self._comparison_html(state, frame, has_pose))
        if trajectory is not self._strip_of:
            self._strip_of = trajectory
            widgets.set_content(self._strip, "" if trajectory is None else _strip(trajectory))
        status = PoseStatus.NONE.value if trajectory is None else str(trajectory.status[frame])
        seconds = (int(recording.timestamp_ns[frame]) - int(recording.timestamp_ns[0])) / 1e9
        facts = [f"Frame {frame} of {len(recording)} · {seconds:.2f} s · {STATUS_TEXT[status]}"]
        support = self._data.tag_support(state.recording, state.annotation.method, frame)
        facts += [support, self._error_text(state, frame), state.renderer_note]
        widgets.set_content(self._facts, widgets.box("<br>".join(widgets.text(fact) for fact in facts if fact)))

    def _comparison_html(self, state: AppState, frame: int, has_pose: bool) -> str:
        name, revision = state.recording, self._data.poses_key(state.recording, state.annotation) or "none"
        camera = self._data.camera(name)
        gaze = gaze_in_frame(self._data, name, frame, camera)
        url = f"/frames/{quote(name)}/{frame}.jpg?rev={self._revision}"
        if state.draws_tags:
            url += f"{state.data_revision}&tags=1"
        values = {
            "FRAME_URL": url,
            "BEFORE_URL": self._before,
            "RENDER_URL": f"/renders/{quote(name)}/{frame}.jpg?rev={quote(revision)}" if has_pose else "",
            "ASPECT": f"{camera.width}/{camera.height}" if camera else "1/1",
            "GAZE_X": f"{100 * gaze[0]:.3f}" if gaze else "-50",
            "GAZE_Y": f"{100 * gaze[1]:.3f}" if gaze else "-50",
            "RENDER_DISPLAY": "block" if has_pose else "none",
            "NONE_DISPLAY": "none" if has_pose else "flex",
        }
        self._before = url
        content = self._template
        for key, value in values.items():
            content = content.replace(f"@{key}@", widgets.text(value))
        return content.replace("@KEYPOINTS@", self._keypoints_svg(state, frame, camera))

    def _keypoints_svg(self, state: AppState, frame: int, camera: Camera | None) -> str:
        if camera is None or not state.layers.is_visible(Layer.KEYPOINTS):
            return ""
        return marks_svg(*marks_in_frame(self._data, state, Side.SFM, frame), camera, state.selected_key)

    def _error_text(self, state: AppState, frame: int) -> str:
        errors = self._data.errors(state.recording, self._data.poses_key(state.recording, state.annotation))
        if errors is None or not np.isfinite(errors.position_m[frame]):
            return ""
        return f"Against the ground truth: {100 * errors.position_m[frame]:.1f} cm, {errors.rotation_deg[frame]:.2f}°"

    def _frame(self) -> int:
        return 0 if self._state is None else self._state.frame

    def _step(self, which: str) -> None:
        if self._state is None:
            return
        frame = self._frame()
        keyframes = self._data.keyframes(self._state.recording)
        if "keyframe" in which and keyframes is not None and len(keyframes):
            later, earlier = keyframes[keyframes > frame], keyframes[keyframes < frame]
            target = (later[0] if len(later) else frame) if "▶" in which else (earlier[-1] if len(earlier) else frame)
        else:
            target = frame + (1 if "▶" in which else -1)
        self._show(int(target))

    def _show(self, frame: int) -> None:
        if self._state is not None:
            last = len(self._data.recording(self._state.recording)) - 1
            self._dispatch(ShowFrame(min(max(frame, 0), last)))


def _strip(trajectory: Trajectory) -> str:
    """A strip below the slider: green where frames have a pose, red where they have none."""
    bins = np.array_split(trajectory.has_pose, min(len(trajectory), STRIP_PARTS))
    share = np.array([part.mean() for part in bins])
    colors = np.where(share > 0.99, "#40c057", np.where(share < 0.5, "#ff8787", "#ffd43b"))
    edges = np.flatnonzero(colors[1:] != colors[:-1]) + 1
    starts, ends = np.concatenate([[0], edges]), np.concatenate([edges, [len(colors)]])
    stops = ",".join(
        f"{colors[a]} {100 * a / len(colors):.1f}% {100 * b / len(colors):.1f}%"
        for a, b in zip(starts.tolist(), ends.tolist(), strict=True)
    )
    style = f"height:6px;margin:2px 74px 10px 112px;border-radius:3px;background:linear-gradient(90deg,{stops})"
    return f'<div style="{style}" title="green: with a pose, yellow: some, red: none"></div>'
