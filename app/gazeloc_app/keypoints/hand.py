"""One browser's hand on the keypoints that are there: arrow keys, and what its page says by URL.

Arrows move what this browser has before it: the click in the frame that it looks through or clicked in the panel, with
the tool for the reconstruction that side, else the place on the scan. Pages name places in pictures as shares of their
width and height (u, v), so that no page needs to know a camera.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from gazeloc_app.actions.action import Action, Notify
from gazeloc_app.actions.picks import MovePoint, Side
from gazeloc_app.data import ProjectData
from gazeloc_app.frames.frame_clicks import click_at, clicked_in_frame, moved_in_frame
from gazeloc_app.frames.looking import Looking
from gazeloc_app.frames.sightings import frame_pose
from gazeloc_app.keypoints.loupe import loupe_view, place_from_text
from gazeloc_app.keypoints.moving import ARROWS, Nudge, nudge_of, nudged, nudged_in_view
from gazeloc_app.keypoints.picking import pick_mesh
from gazeloc_app.keypoints.snapping import NEAR_PX
from gazeloc_app.placement import shown_scan_from_sfm
from gazeloc_app.state import AppState, Level
from gazeloc_core.arrays import Floats
from gazeloc_core.camera import Camera
from gazeloc_core.errors import InputError
from gazeloc_core.keypoints import KeypointPair
from gazeloc_core.sfm_model import SfmModel
from gazeloc_core.surfaces.viewpoint import up_vector

_LEAST_ACROSS_PX, _MOST_ACROSS_PX = 40.0, 20_000.0


@dataclass(frozen=True, eq=False)
class Reach:
    """What a hand works with: `front()` as of `picking.pick_mesh`, `is_in_cloud()` whether the tool in hand sets points
    in the reconstruction, `moves()` and `snaps()` as of `tool.Bench`."""

    client: Any
    data: ProjectData
    looking: Looking
    state: Callable[[], AppState]
    dispatch: Callable[[Action], None]
    front: Callable[[], int]
    is_in_cloud: Callable[[], bool]
    moves: Callable[[], bool]
    snaps: Callable[[], bool]


class Hand:
    """Moves the selected keypoint, and sets it in frames of the panel."""

    def __init__(self, reach: Reach):
        self._reach = reach
        self._in_panel: int | None = None
        """The frame of the recording in whose picture in the panel this browser clicked last."""

    def look_elsewhere(self) -> None:
        """The scene was clicked: arrows no longer move the click in the panel's frame."""
        self._in_panel = None

    def nudge(self, nudge: Nudge) -> None:
        """Move the selected keypoint by an arrow key."""
        state = self._reach.state()
        pair = self._selected(state)
        if pair is None:
            return  # arrows turn the view
        for actions in (self._nudge_click(state, pair, nudge), self._nudge_place(state, pair, nudge)):
            if actions:
                self._do(actions)
                return
        self._say("The selected keypoint has no place here that arrows could move; click one first.")

    def press_arrow(self, query: Mapping[str, str]) -> None:
        """`key`, one of `moving.ARROWS`, with `shift=1` or not: a page's arrow key."""
        key = query.get("key", "")
        if key not in ARROWS:
            raise InputError(f"{key[:20]!r} is no arrow key.")
        self.nudge(nudge_of(key, is_shifted=query.get("shift") == "1"))

    def click_in_frame(self, query: Mapping[str, str]) -> None:
        """`frame`, `u`, `v`: a click in the picture of a frame of the recording, `across` pixels wide on the screen.

        With a `key` that pair's click there is moved, or made. `lens=1` where the picture is not undistorted.
        """
        reach, state = self._reach, self._reach.state()
        frame, camera = _whole(query, "frame"), reach.data.camera(state.recording)
        if frame >= len(reach.data.recording(state.recording)) or camera is None:
            raise InputError(f"There is no frame {frame} to click in.")
        pixel = self._pixel(query, camera)
        self._in_panel = frame
        if pixel is None:
            self._say("The undistorted frame does not have that part; click nearer to the middle.")
        elif "key" in query:
            self._do(self._place_click(state, query["key"], frame, pixel))
        elif frame_pose(reach.data, state, frame) is None:
            self._say(_not_in_reconstruction(reach.data.model(state.recording), frame))
        else:
            across = _number(query, "across", _LEAST_ACROSS_PX, _MOST_ACROSS_PX)
            reach_px = NEAR_PX * camera.width / across if reach.snaps() else 0.0
            moves = reach.moves()
            self._do(clicked_in_frame(reach.data, state, Side.SFM, frame, pixel, moves=moves, reach_px=reach_px))

    def click_in_loupe(self, query: Mapping[str, str]) -> None:
        """`key`, `at`, `from`, `u`, `v`: a click in the loupe that shows the scan; the pair's place moves there."""
        reach = self._reach
        place, eye = (place_from_text(query.get(name, "")) for name in ("at", "from"))
        camera, pose = loupe_view(place, eye, up_vector(reach.data.scan().up_axis))
        u, v = (_number(query, name, 0.0, 1.0) for name in "uv")
        ray = pose.rotation.apply(camera.unproject([[u * camera.width, v * camera.height]])[0])
        found = pick_mesh(reach.data.raycaster(), eye, ray, reach.front())
        if found is None:
            self._say("There is no scan under the click.")
            return
        x, y, z = found.tolist()
        reach.dispatch(MovePoint(query.get("key", ""), (x, y, z)))

    def _nudge_click(self, state: AppState, pair: KeypointPair, nudge: Nudge) -> list[Action]:
        target = self._reach.looking.pictured
        if target is not None:
            side, frame = target.side, target.frame
        elif self._in_panel is not None and self._in_panel == state.frame:
            side, frame = Side.SFM, self._in_panel
        else:
            return []
        click = click_at(pair, side, frame)
        if click is None:
            return []
        pixel = (click.x_px + nudge.screen[0] * nudge.step_px, click.y_px + nudge.screen[1] * nudge.step_px)
        return moved_in_frame(self._reach.data, state, side, pair.key, frame, pixel)

    def _nudge_place(self, state: AppState, pair: KeypointPair, nudge: Nudge) -> list[Action]:
        wxyz = np.asarray(self._reach.client.camera.wxyz)
        scan_from_sfm = shown_scan_from_sfm(self._reach.data, state) if pair.sfm is not None else None
        in_cloud = self._reach.is_in_cloud() or pair.scan is None
        if in_cloud and pair.sfm is not None and scan_from_sfm is not None:
            moved = nudged_in_view(scan_from_sfm.apply(pair.sfm), nudge, wxyz)
            x, y, z = scan_from_sfm.inverse().apply(moved).tolist()
            return [MovePoint(pair.key, (x, y, z), Side.SFM)]
        if pair.scan is None:
            return []
        return [MovePoint(pair.key, nudged(self._reach.data.raycaster(), pair.scan, nudge, wxyz))]

    def _place_click(self, state: AppState, key: str, frame: int, pixel: Floats) -> list[Action]:
        pair = state.annotation.keypoints.get(key)
        if pair is None:
            raise InputError(f"There is no keypoint {key[:20]!r}.")
        if click_at(pair, Side.SFM, frame) is not None:
            return moved_in_frame(self._reach.data, state, Side.SFM, key, frame, (float(pixel[0]), float(pixel[1])))
        if key != state.selected_key or (pair.sfm is not None and not pair.sightings and not self._reach.moves()):
            text = f"“{pair.name}” was set among the points; tick “Move point” to set it in frames instead."
            return [Notify(Level.INFO, text)]
        return clicked_in_frame(self._reach.data, state, Side.SFM, frame, pixel, moves=self._reach.moves())

    def _pixel(self, query: Mapping[str, str], camera: Camera) -> Floats | None:
        """The pixel (2,) of the undistorted frame that `u` and `v` say; None for one that it does not have."""
        u, v = (_number(query, name, 0.0, 1.0) for name in "uv")
        if query.get("lens") != "1":
            return np.array([u * camera.width, v * camera.height])
        lens = self._reach.data.recording(self._reach.state().recording).camera
        pixel = camera.project(lens.unproject([[u * lens.width, v * lens.height]]))
        return np.asarray(pixel[0]) if camera.contains(pixel)[0] else None

    def _selected(self, state: AppState) -> KeypointPair | None:
        return state.annotation.keypoints.get(state.selected_key) if state.selected_key else None

    def _do(self, actions: Iterable[Action]) -> None:
        for action in actions:
            self._reach.dispatch(action)

    def _say(self, sentence: str) -> None:
        self._reach.dispatch(Notify(Level.INFO, sentence))


def _not_in_reconstruction(model: SfmModel | None, frame: int) -> str:
    frames = np.zeros(0, np.int64) if model is None else model.frame_indices[model.frame_indices >= 0]
    if len(frames) == 0:
        return "There is no reconstruction yet, so a click in a frame says no place; run the stages first."
    nearest = int(frames[np.abs(frames - frame).argmin()])
    return (
        f"Frame {frame} is no keyframe of the reconstruction, so a click in it says no place; frame {nearest} is one."
    )


def _whole(query: Mapping[str, str], name: str) -> int:
    return int(_number(query, name, 0, 1e9))


def _number(query: Mapping[str, str], name: str, low: float, high: float) -> float:
    text = query.get(name, "")
    try:
        value = float(text[:40])
    except ValueError:
        value = math.nan
    if not low <= value <= high:
        raise InputError(f"{name}={text[:40]!r} is no number from {low:g} to {high:g}.")
    return value
