"""The comparison in the panel “Frame”: which pictures the page shows of a frame. How it shows them is the page's own.

The page's half is static/page/comparison.js and .css; the pictures are URLs of our own routes (pictures.py). The URLs
have `{}` for the frame's number, and which frames have a pose is said too, so that a page can go to another frame
before it is told of that one (static/page/scrub.js).
"""

from __future__ import annotations

import secrets
from pathlib import Path
from urllib.parse import quote

import numpy as np
from viser import GuiApi

from gazeloc_app import widgets
from gazeloc_app.actions.picks import Side
from gazeloc_app.data import ProjectData
from gazeloc_app.drawing.pictures import render_url
from gazeloc_app.frames.frame_marks import marks_in_frame
from gazeloc_app.frames.gaze_at import gaze_as_recorded, gaze_in_frame
from gazeloc_app.panels.marks_svg import marks_svg
from gazeloc_app.panels.meanwhile import meanwhile
from gazeloc_app.state import AppState, Layer
from gazeloc_app.work import tasks

_HOME = """<div class="gazeloc-comparison">
  <img alt="" src="data:," style="display:none" onerror="gazelocComparison.home(this.parentNode)">
</div>"""
"""Where the pictures are: never replaced, so that nothing jumps while frames go by."""
NO_POSES = "No poses yet: press “Run everything” in the tab Project, or align keypoints in the tab Align."
NO_POSE = (
    "This frame has no pose, so there is no render of it; “keyframe ▶” and the timeline lead to frames that have one."
)


class ComparisonHtml:
    """The place of the pictures, and a hidden piece of HTML that names those of a frame."""

    def __init__(self, gui: GuiApi, template: Path, data: ProjectData):
        self._template = template.read_text(encoding="utf-8")
        self._data = data
        self._revision = secrets.token_hex(4)  # the frames of this session; the browser may keep them
        gui.add_html(_HOME)
        self._html = gui.add_html("")
        self._marks: object = None
        self._marks_revision = 0

    def show(self, state: AppState, frame: int, other: tuple[str, str | None] | None = None) -> None:
        """The state's frame; `other` names other poses to compare with: a text for people, and their key."""
        key = self._data.poses_key(state.recording, state.annotation)
        values = {
            "NUMBER": str(frame),
            "LAST": str(len(self._data.recording(state.recording)) - 1),
            "SHOW_URL": f"/show/{quote(state.recording)}/",
            "NONE": self._why_none(state, key, frame),
            "MARKS": str(self._revision_of_marks(state)),
            **self._pictures(state, key, other),
            **self._shapes(state, frame),
        }
        content = self._template
        for name, value in values.items():
            content = content.replace(f"@{name}@", widgets.text(value))
        widgets.set_content(self._html, content.replace("@KEYPOINTS@", self._keypoints_svg(state, frame)))

    def _revision_of_marks(self, state: AppState) -> int:
        """Counts up where keypoints in frames may have changed: pages remember frames by it."""
        annotation = state.annotation
        chosen = (annotation.alignment, state.selected_key, state.layers.is_visible(Layer.KEYPOINTS))
        marks = (annotation.keypoints, *chosen, state.data_revision)
        if marks != self._marks:
            self._marks = marks
            self._marks_revision += 1
        return self._marks_revision

    def _why_none(self, state: AppState, key: str | None, frame: int) -> str:
        trajectory = self._data.trajectory(state.recording, key)
        if trajectory is None or not trajectory.has_pose.any():
            at_work = meanwhile(state, tasks.run_all, tasks.align)
            return f"No poses yet: {at_work}" if at_work else NO_POSES
        return NO_POSE if frame >= len(trajectory) or not trajectory.has_pose[frame] else ""

    def _keypoints_svg(self, state: AppState, frame: int) -> str:
        camera = self._data.camera(state.recording)
        if camera is None or not state.layers.is_visible(Layer.KEYPOINTS):
            return ""
        marks, lines = marks_in_frame(self._data, state, Side.SFM, frame)
        return marks_svg(marks, lines, camera, state.selected_key, frame)

    def _pictures(self, state: AppState, key: str | None, other: tuple[str, str | None] | None) -> dict[str, str]:
        url = f"/frames/{quote(state.recording)}/{{}}.jpg?rev={self._revision}"
        if state.layers.draws_tags:
            url += f"{state.data_revision}&tags=1"
        render, poses = self._renders(state.recording, key)
        other_render, other_poses = self._renders(state.recording, other[1] if other else None)
        names = [name_of_poses(state), *([other[0].replace("|", " ")] if other else [])]
        return {
            "FRAME_URL": url,
            "RENDER_URL": render,
            "OTHER_URL": other_render,
            "POSES": poses,
            "OTHER_POSES": other_poses,
            "NAMES": "|".join(names),
        }

    def _renders(self, recording: str, key: str | None) -> tuple[str, str]:
        """The URL of renders from the poses of a key, and which frames have one: a bit each, as hexadecimal digits."""
        trajectory = None if key is None else self._data.trajectory(recording, key)
        if key is None or trajectory is None:
            return "", ""
        url = render_url(self._data, recording, key, "{}")
        return url, np.packbits(trajectory.has_pose).tobytes().hex()

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
