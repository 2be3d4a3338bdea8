"""The comparison in the panel “Frame”: which pictures the page shows of a frame. How it shows them is the page's own.

The page's half is static/page/comparison.js and .css; the pictures are URLs of our own routes (pictures.py).
"""

from __future__ import annotations

import secrets
from pathlib import Path
from urllib.parse import quote

from viser import GuiApi

from gazeloc_app import widgets
from gazeloc_app.actions.picks import Side
from gazeloc_app.data import ProjectData
from gazeloc_app.frames.frame_marks import marks_in_frame
from gazeloc_app.frames.gaze_at import gaze_as_recorded, gaze_in_frame
from gazeloc_app.panels.marks_svg import marks_svg
from gazeloc_app.state import AppState, Layer
from gazeloc_core.trajectory import PoseStatus

_AHEAD = (1, -1, 2)
"""The frames, from the one that is shown, whose pictures a page may fetch while it is idle."""


class ComparisonHtml:
    """A piece of HTML that names a frame's pictures."""

    def __init__(self, gui: GuiApi, template: Path, data: ProjectData):
        self._template = template.read_text(encoding="utf-8")
        self._data = data
        self._revision = secrets.token_hex(4)  # the frames of this session; the browser may keep them
        self._html = gui.add_html("")

    def show(self, state: AppState, frame: int, other: tuple[str, str | None] | None = None) -> None:
        """The state's frame; `other` names other poses to compare with: a text for people, and their key."""
        values = {
            "NUMBER": str(frame),
            "LAST": str(len(self._data.recording(state.recording)) - 1),
            **self._pictures(state, frame, other),
            **self._shapes(state, frame),
        }
        content = self._template
        for key, value in values.items():
            content = content.replace(f"@{key}@", widgets.text(value))
        widgets.set_content(self._html, content.replace("@KEYPOINTS@", self._keypoints_svg(state, frame)))

    def _keypoints_svg(self, state: AppState, frame: int) -> str:
        camera = self._data.camera(state.recording)
        if camera is None or not state.layers.is_visible(Layer.KEYPOINTS):
            return ""
        marks, lines = marks_in_frame(self._data, state, Side.SFM, frame)
        return marks_svg(marks, lines, camera, state.selected_key, frame)

    def _pictures(self, state: AppState, frame: int, other: tuple[str, str | None] | None) -> dict[str, str]:
        key = self._data.poses_key(state.recording, state.annotation)
        url = f"/frames/{quote(state.recording)}/{frame}.jpg?rev={self._revision}"
        if state.draws_tags:
            url += f"{state.data_revision}&tags=1"
        last = len(self._data.recording(state.recording)) - 1
        around = [frame + step for step in _AHEAD if 0 <= frame + step <= last]
        return {
            "FRAME_URL": url,
            "RENDER_URL": self._render_url(state.recording, key, frame),
            "OTHER_URL": self._render_url(state.recording, other[1], frame) if other else "",
            "NAMES": "|".join([name_of_poses(state), *([other[0].replace("|", " ")] if other else [])]),
            "POSED": " ".join(f"{at}:{int(self._has_pose(state.recording, key, at))}" for at in around),
        }

    def _render_url(self, recording: str, key: str | None, frame: int) -> str:
        if key is None or not self._has_pose(recording, key, frame):
            return ""
        return f"/renders/{quote(recording)}/{frame}.jpg?rev={quote(key)}"

    def _has_pose(self, recording: str, key: str | None, frame: int) -> bool:
        trajectory = self._data.trajectory(recording, key)
        if trajectory is None or frame >= len(trajectory):
            return False
        return PoseStatus(str(trajectory.status[frame])).has_pose

    def _shapes(self, state: AppState, frame: int) -> dict[str, str]:
        camera, lens = self._data.camera(state.recording), self._data.recording(state.recording).camera
        shapes = {"ASPECT": camera or lens, "LENS_ASPECT": lens}
        gazes = {
            "GAZE": gaze_in_frame(self._data, state.recording, frame, camera),
            "LENS_GAZE": gaze_as_recorded(self._data, state.recording, frame),
        }
        values = {name: f"{shape.width}/{shape.height}" for name, shape in shapes.items()}
        return values | {name: f"{100 * at[0]:.3f} {100 * at[1]:.3f}" if at else "" for name, at in gazes.items()}


def name_of_poses(state: AppState) -> str:
    """Whose poses are shown, for people."""
    method, key = state.annotation.method, state.annotation.alignment
    return f"{method} {key}" if method.has_model and key and method.value == "sfm" else method.value
