"""The selected keypoint under a loupe, on the scan and in frames that see it: a small window over the 3D view.

The page gives it its place, and tells where in it was clicked (static/page/loupe.js). The frames are enlarged by CSS,
from pictures that the page mostly has already.
"""

from __future__ import annotations

import secrets
from dataclasses import replace
from urllib.parse import quote

import numpy as np
from viser import GuiApi

from gazeloc_app import palette, widgets
from gazeloc_app.actions.picks import Side
from gazeloc_app.data import ProjectData
from gazeloc_app.frames.frame_marks import Mark, marks_in_frame
from gazeloc_app.keypoints.loupe import ACROSS_M, loupe_places, loupe_url
from gazeloc_app.state import AppState
from gazeloc_core.camera import Camera
from gazeloc_core.keypoints import KeypointPair, KeypointSet

MOST_FRAMES = 2
"""Frames beside the scan; the ones that were clicked come first."""
ENLARGED = 4.0
"""How many times larger than to fit its box a frame is shown."""
BOX_PX = 150
_PIN = '<img alt="" src="data:," style="display:none" onerror="gazelocLoupe.pin(this.parentNode)">'


class LoupePanel:
    """Boxes side by side with a crosshair each; empty while no keypoint is selected."""

    def __init__(self, gui: GuiApi, data: ProjectData):
        self._data = data
        self._seen: object = None
        self._revision = secrets.token_hex(4)  # the frames of this session; the browser may keep them
        self._html = gui.add_html("")

    def render(self, state: AppState) -> None:
        """Show the selected keypoint."""
        pair = state.annotation.keypoints.get(state.selected_key) if state.selected_key else None
        seen = (pair, state.recording, state.annotation.alignment, state.data_revision)
        if seen == self._seen:
            return
        self._seen = seen
        boxes = [] if pair is None else self._boxes(state, pair)
        content = _PIN
        if pair is not None and boxes:
            names = f'data-key="{widgets.text(pair.key)}" data-name="{widgets.text(pair.name)}"'
            content = f'<div class="gazeloc-loupe-boxes" hidden {names}>{"".join(boxes)}</div>{_PIN}'
        widgets.set_content(self._html, f"<div>{content}</div>")

    def _boxes(self, state: AppState, pair: KeypointPair) -> list[str]:
        boxes = []
        if pair.scan is not None:
            at, start = loupe_places(self._data, state, pair.scan)
            place = f'data-at="{at}" data-from="{start}"'
            url = loupe_url(at, start, state.data_revision)
            boxes.append(_box(url, (0.0, 0.0, BOX_PX, BOX_PX), place, f"scan, {100 * ACROSS_M:.0f} cm across"))
        camera = self._data.camera(state.recording)
        if camera is not None:
            marks = self._marks(state, pair)[: MOST_FRAMES + (pair.scan is None)]
            boxes += [self._frame_box(state.recording, frame, mark, camera) for frame, mark in marks]
        return boxes

    def _marks(self, state: AppState, pair: KeypointPair) -> list[tuple[int, Mark]]:
        """Frames of the reconstruction with the pair in them, the clicked ones first, then where it is most central."""
        model, camera = self._data.model(state.recording), self._data.camera(state.recording)
        if model is None or camera is None:
            return []
        alone = replace(state, annotation=replace(state.annotation, keypoints=KeypointSet((pair,))))
        found: list[tuple[int, Mark]] = []
        clicked = {click.frame_index for click in pair.sightings}
        for frame in sorted(clicked | set(_spread([int(frame) for frame in model.frame_indices if frame >= 0]))):
            marks, _ = marks_in_frame(self._data, alone, Side.SFM, frame)
            found += [(frame, mark) for mark in marks]
        middle = np.array([camera.width, camera.height]) / 2
        return sorted(
            found, key=lambda item: (not item[1].is_clicked, np.hypot(*(middle - (item[1].x_px, item[1].y_px))))
        )

    def _frame_box(self, recording: str, frame: int, mark: Mark, camera: Camera) -> str:
        url = f"/loupe/{quote(recording)}/{frame}.jpg?rev={self._revision}"
        wide, high = ENLARGED * BOX_PX, ENLARGED * BOX_PX * camera.height / camera.width
        left, top = BOX_PX / 2 - wide * mark.x_px / camera.width, BOX_PX / 2 - high * mark.y_px / camera.height
        caption = f"frame {frame}, {'clicked' if mark.is_clicked else 'expected'}"
        return _box(url, (left, top, wide, high), f'data-frame="{frame}"', caption)


def _spread(frames: list[int], most: int = 24) -> list[int]:
    """At most so many of the frames, evenly: which of two neighbours is shown does not matter."""
    return frames[:: max(1, -(-len(frames) // most))]


def _box(url: str, picture: tuple[float, float, float, float], names: str, caption: str) -> str:
    """A square that shows a part of a picture, whose left, top, width and height in it are given in pixels."""
    left, top, wide, high = picture
    background = f"{palette.meaning('dark')} url('{url}') {left:.1f}px {top:.1f}px/{wide:.1f}px {high:.1f}px no-repeat"
    cross = "".join(
        f'<i style="{along}:{share}%;{across}:50%;{size}:15%;{thin}:1px"></i>'
        for along, across, size, thin in (("top", "left", "height", "width"), ("left", "top", "width", "height"))
        for share in (30, 55)
    )
    numbers = " ".join(f"{value:.3f}" for value in picture)
    return (
        f'<figure><div class="gazeloc-loupe-box" {names} data-picture="{numbers}" '
        f'style="width:{BOX_PX}px;height:{BOX_PX}px;background:{background}">{cross}</div>'
        f"<figcaption>{widgets.text(caption)}</figcaption></figure>"
    )
