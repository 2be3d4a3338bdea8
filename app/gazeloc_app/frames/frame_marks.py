"""What is known of the keypoints in one frame, the recording's or the phone's: clicks, expected places, lines.

And which frames see a keypoint, so that it can be clicked in another one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import RigidTransform

from gazeloc_app.actions.picks import Side
from gazeloc_app.data import ProjectData
from gazeloc_app.frames.sightings import frame_pose
from gazeloc_app.placement import shown_scan_from_sfm
from gazeloc_app.state import AppState
from gazeloc_core.arrays import Floats
from gazeloc_core.clicks.keypoint_views import View, line_of_click
from gazeloc_core.keypoints import KeypointPair
from gazeloc_core.transforms import Similarity

HIDDEN_M = 0.15
"""A surface that is nearer than the place by more than this hides it."""


@dataclass(frozen=True)
class Mark:
    """A keypoint in a frame, at a pixel: clicked there (`is_clicked`), or where it is expected."""

    key: str
    name: str
    x_px: float
    y_px: float
    is_clicked: bool


@dataclass(frozen=True, eq=False)
class Line:
    """Pixels (N, 2) along which a keypoint lies that was clicked in one other frame."""

    key: str
    pixels: Floats


def view_of(data: ProjectData, state: AppState, side: Side, frame: int) -> View | None:
    """A frame of one side as a view in the scan: of the recording (undistorted) or of the phone's with pictures."""
    if side is Side.SCAN:
        photos = data.scan().frames_with_images
        return View(photos[frame].camera, photos[frame].scan_from_camera) if 0 <= frame < len(photos) else None
    camera = data.camera(state.recording)
    pose = frame_pose(data, state, frame)
    if pose is None:
        pose = _estimated_pose(data, state, frame)
    return None if camera is None or pose is None else View(camera, pose)


def marks_in_frame(data: ProjectData, state: AppState, side: Side, frame: int) -> tuple[list[Mark], list[Line]]:
    """The marks and lines of all keypoints in a frame; a frame without pose has its clicks alone."""
    view, scan_from_sfm = view_of(data, state, side, frame), shown_scan_from_sfm(data, state)
    marks: list[Mark] = []
    lines: list[Line] = []
    for pair in state.annotation.keypoints:
        clicks = side.sightings_of(pair)
        here = next((click for click in clicks if click.frame_index == frame), None)
        if here is not None:
            marks.append(Mark(pair.key, pair.name, here.x_px, here.y_px, is_clicked=True))
            continue
        place = place_of(pair, side, scan_from_sfm, is_aligned=state.annotation.alignment is not None)
        if view is None:
            continue
        if place is not None:
            pixel = view.pixel_of(place)
            if pixel is not None:
                marks.append(Mark(pair.key, pair.name, *pixel, is_clicked=False))
        elif len(clicks) == 1:
            other = view_of(data, state, side, clicks[0].frame_index)
            if other is not None:
                pixels = line_of_click(other, clicks[0].x_px, clicks[0].y_px, view)
                lines += [Line(pair.key, pixels)] if len(pixels) > 1 else []
    return marks, lines


def place_of(pair: KeypointPair, side: Side, scan_from_sfm: Similarity | None, *, is_aligned: bool) -> Floats | None:
    """Where a keypoint is expected in the frame `scan`: by its own side, else by the other under the alignment."""
    in_scan = None if pair.scan is None else np.array(pair.scan)
    moved = None if pair.sfm is None or scan_from_sfm is None else scan_from_sfm.apply(pair.sfm)
    own, other = (in_scan, moved) if side is Side.SCAN else (moved, in_scan)
    return own if own is not None or not is_aligned else other


def next_frame_seeing(data: ProjectData, state: AppState, side: Side, after: int) -> int | None:
    """The next frame, round and round, in which the selected keypoint is in the picture and nothing hides it.

    Of a keypoint that was clicked in one frame only: in which its line is. None where no other frame sees it.
    """
    pair = state.annotation.keypoints.get(state.selected_key) if state.selected_key else None
    frames = _frames(data, state, side)
    if pair is None or not frames:
        return None
    later = [frame for frame in frames if frame > after] + [frame for frame in frames if frame < after]
    place = place_of(pair, side, shown_scan_from_sfm(data, state), is_aligned=state.annotation.alignment is not None)
    clicks = side.sightings_of(pair)
    seen_by = view_of(data, state, side, clicks[0].frame_index) if len(clicks) == 1 else None
    for frame in later:
        view = view_of(data, state, side, frame)
        if view is None:
            continue
        if place is not None:
            says_nothing = (
                side is Side.SFM and state.annotation.alignment is None
            )  # the scan, of where nothing is known
            if view.pixel_of(place) is not None and (says_nothing or not _is_hidden(data, place, view)):
                return frame
        elif seen_by is not None and len(line_of_click(seen_by, clicks[0].x_px, clicks[0].y_px, view)) > 1:
            return frame
    return None


def _frames(data: ProjectData, state: AppState, side: Side) -> list[int]:
    if side is Side.SCAN:
        return list(range(len(data.scan().frames_with_images)))
    model = data.model(state.recording)
    return [] if model is None else sorted(int(frame) for frame in model.frame_indices if frame >= 0)


def _is_hidden(data: ProjectData, place: Floats, view: View) -> bool:
    """Whether the scan stands between."""
    eye = np.asarray(view.scan_from_camera.translation)
    away = float(np.linalg.norm(place - eye))
    hit = data.raycaster().cast(eye, (place - eye) / max(away, 1e-9))
    return bool(hit.is_hit[0] and hit.distance[0] < away - HIDDEN_M)


def _estimated_pose(data: ProjectData, state: AppState, frame: int) -> RigidTransform | None:
    trajectory = data.trajectory(state.recording, data.poses_key(state.recording, state.annotation))
    return None if trajectory is None or frame >= len(trajectory) else trajectory.pose(frame)
