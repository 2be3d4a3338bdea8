"""All cameras in the scene: the phone's, the true ones, those of each method, and how far estimates are from the truth.

Each set is one node of lines. Of many cameras every n-th is drawn, the path through all.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import viser
from scipy.spatial.transform import RigidTransform

from gazeloc_app.data import ProjectData
from gazeloc_app.once import Once
from gazeloc_app.palette import STATUSES, UNDER
from gazeloc_app.scene.errors import ErrorsLayer
from gazeloc_app.scene.frusta import CameraSet, FrustaLayer
from gazeloc_app.state import AppState, Coloring, Layer
from gazeloc_core.arrays import Bytes, Floats
from gazeloc_core.camera import Camera
from gazeloc_core.charts.color_scale import NO_VALUE, ColorScale
from gazeloc_core.evaluation.evaluate import match_times
from gazeloc_core.methods import Method
from gazeloc_core.surfaces.glb import Rgb
from gazeloc_core.trajectory import Trajectory

MANY = 400
"""More cameras of one set than this hide the room: unless somebody says otherwise they are thinned out to as many."""


class SceneCameras:
    """The layers of cameras, and what each of them shows."""

    def __init__(self, scene: viser.SceneApi, data: ProjectData):
        self._data = data
        self._once = Once()
        self.phone = FrustaLayer(scene, "phone", depth_m=0.08)
        self.truth = FrustaLayer(scene, "truth")
        self.estimate = FrustaLayer(scene, "estimate")
        self.compared = {method: FrustaLayer(scene, f"methods/{method}", depth_m=0.09) for method in Method}
        self.errors = ErrorsLayer(scene)

    def render(self, state: AppState) -> None:
        """Draw the state's cameras."""
        self._draw_phone(state)
        camera = self._data.camera(state.recording)
        camera = camera if camera is not None and camera.is_pinhole else None
        truth, step = self._data.true_keyframes(state.recording), self.thinning(state)
        color = state.annotation.tint(Layer.TRUTH) or (
            state.cameras.truth if state.layers.coloring is Coloring.SET else UNDER
        )
        self._once("truth", (truth, camera, color, step), lambda: self.truth.show(_thinned(truth, camera, color, step)))
        scale = self.scale(state)
        for method in Method:
            self._draw_method(state, method, camera, step, scale)
        self._draw_errors(state, scale)

    def thinning(self, state: AppState) -> int:
        """Every how many cameras of the recording one is drawn: what people chose, or few enough to see the room."""
        if state.layers.thinning is not None:
            return state.layers.thinning
        truth, trajectory = self._data.true_keyframes(state.recording), self._trajectory(state, None)
        counts = [0 if truth is None else len(truth)]
        counts += [0 if trajectory is None else len(_shown_frames(trajectory, state.layers.coloring))]
        return max(1, -(-max(counts) // MANY))

    def scale(self, state: AppState) -> ColorScale | None:
        """The scale of the colours in force; None where they stand for no number, or no frame has one."""
        values = self._values(state, state.annotation.method)
        if values is None:
            return None
        is_error = state.layers.coloring is Coloring.ERROR
        return ColorScale.of_errors(values) if is_error else ColorScale.of_range(values)

    def _draw_phone(self, state: AppState) -> None:
        scan, color = self._data.scan(), state.annotation.tint(Layer.PHONE) or state.cameras.phone

        def show() -> None:
            poses = [frame.scan_from_camera for frame in scan.frames]
            camera = scan.frames[0].camera if scan.frames else None
            if camera is None or not camera.is_pinhole:
                self.phone.show(None)
                return
            step = max(1, -(-len(poses) // MANY))
            self.phone.show(_thinned(RigidTransform.concatenate(poses), camera, color, step))

        self._once("phone", (scan, color), show)

    def _draw_method(
        self, state: AppState, method: Method, camera: Camera | None, step: int, scale: ColorScale | None
    ) -> None:
        is_chosen = method is state.annotation.method
        layer = self.estimate if is_chosen else self.compared[method]
        trajectory = self._trajectory(state, method) if is_chosen or method in state.layers.compared else None
        tint = state.annotation.tint(Layer.ESTIMATE) if is_chosen else None
        color: Rgb = tint or (state.cameras.estimate if is_chosen else state.cameras.methods[method])
        coloring = state.layers.coloring
        values = self._values(state, method) if trajectory is not None else None

        def show() -> None:
            if trajectory is None or camera is None:
                layer.show(None)
                return
            colors = _colors(trajectory, color, coloring, values, scale)
            frames = _shown_frames(trajectory, coloring)[::step]
            poses = trajectory.poses(frames) if len(frames) else None
            path = trajectory.centers if is_chosen else None
            shown = None if poses is None else CameraSet(poses, camera, colors[frames], path, colors)
            layer.show(shown)

        if is_chosen:
            self._once(f"compared {method}", None, lambda: self.compared[method].show(None))
        name = "estimate" if is_chosen else f"compared {method}"
        self._once(name, (trajectory, camera, color, step, coloring, _Same(values), scale), show)

    def _draw_errors(self, state: AppState, scale: ColorScale | None) -> None:
        is_visible = state.layers.is_visible(Layer.ERRORS)
        trajectory, truth = self._trajectory(state, None), self._data.truth(state.recording)
        errors = self._errors(state, None) if is_visible else None
        scale = scale if state.layers.coloring is Coloring.ERROR else None
        step = self.thinning(state)

        def show() -> None:
            if trajectory is None or truth is None or errors is None:
                self.errors.show(None, None)
                return
            frames = _shown_frames(trajectory, state.layers.coloring)[::step]
            frames = frames[np.isfinite(errors[frames])]
            rows = match_times(trajectory.timestamp_ns[frames], truth[0])
            segments = np.stack([trajectory.centers[frames], np.asarray(truth[1].translation)[rows]], axis=1)
            in_scale = scale or ColorScale.of_errors(errors)
            self.errors.show(segments, None if in_scale is None else in_scale.colors(errors[frames]))

        self._once("errors", (trajectory, _Same(errors), is_visible, step, scale, state.layers.coloring), show)

    def _values(self, state: AppState, method: Method) -> Floats | None:
        """The number (N,) of each frame that the colours stand for, NaN where there is none."""
        match state.layers.coloring:
            case Coloring.ERROR:
                return self._errors(state, method)
            case Coloring.SCORE:
                key = self._data.poses_key(state.recording, state.annotation, method)
                scores = self._data.frame_scores(state.recording, key)
                return None if scores is None else scores.score
        return None

    def _errors(self, state: AppState, method: Method | None) -> Floats | None:
        key = self._data.poses_key(state.recording, state.annotation, method)
        errors = self._data.errors(state.recording, key)
        return None if errors is None else errors.position_m

    def _trajectory(self, state: AppState, method: Method | None) -> Trajectory | None:
        return self._data.trajectory(state.recording, self._data.poses_key(state.recording, state.annotation, method))


class _Same:
    """An array compared by being the very same one."""

    def __init__(self, array: Floats | None):
        self._array = array

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same) and other._array is self._array

    __hash__ = None  # type: ignore[assignment]


def _shown_frames(trajectory: Trajectory, coloring: Coloring) -> Any:
    """The frames (K,) that are drawn: keyframes; where statuses are shown, all that have a pose."""
    return np.flatnonzero(trajectory.has_pose) if coloring is Coloring.STATUS else trajectory.localised_keyframes


def _colors(
    trajectory: Trajectory, color: Rgb, coloring: Coloring, values: Floats | None, scale: ColorScale | None
) -> Bytes:
    """The colour (N, 3) of every frame."""
    count = len(trajectory)
    if coloring is Coloring.STATUS:
        colors = np.tile(np.array(NO_VALUE, dtype=np.uint8), (count, 1))
        for status, of_status in STATUSES.items():
            colors[trajectory.status == status.value] = of_status
        return colors
    if coloring is Coloring.SET:
        return np.tile(np.array(color, dtype=np.uint8), (count, 1))
    known = np.full(count, np.nan) if values is None or scale is None else values
    return (scale or ColorScale(0, 1)).colors(known)


def _thinned(poses: RigidTransform | None, camera: Camera | None, color: Rgb, step: int) -> CameraSet | None:
    """Every `step`-th camera in one colour; None without any."""
    if poses is None or camera is None or len(poses) == 0:
        return None
    return CameraSet(poses[::step], camera, color)
