"""Camera poses as little pyramids: one node of lines per set, however many cameras there are."""

from __future__ import annotations

import numpy as np
import viser
from scipy.spatial.transform import RigidTransform

from gazeloc_core.arrays import Floats
from gazeloc_core.camera import Camera
from gazeloc_core.glb import Rgb, lines_glb, polyline_segments

TRUTH: Rgb = (20, 170, 60)
ESTIMATE: Rgb = (220, 30, 40)
PHONE: Rgb = (70, 110, 200)
LINES_PER_FRUSTUM = 10


def frustum_segments(scan_from_camera: RigidTransform, camera: Camera, depth_m: float) -> Floats:
    """The lines (K, 10, 2, 3) of K cameras: four edges, the picture's frame, and a roof that marks its top."""
    w, h = camera.width, camera.height
    corners = camera.unproject(np.array([[0, 0], [w, 0], [w, h], [0, h], [w / 2, 0]]))
    corners = depth_m * corners / corners[:, 2:]
    roof = corners[4] - 0.15 * (corners[3] - corners[0])
    apex, base = np.zeros((4, 3)), corners[:4]
    in_camera = np.concatenate(
        [
            np.stack([apex, base], axis=1),
            np.stack([base, np.roll(base, -1, axis=0)], axis=1),
            np.array([[base[0], roof], [roof, base[1]]]),
        ]
    )
    rotations = np.reshape(scan_from_camera.rotation.as_matrix(), (-1, 3, 3))
    centers = np.reshape(scan_from_camera.translation, (-1, 3))
    return np.asarray(np.einsum("kij,lej->klei", rotations, in_camera) + centers[:, None, None])


class FrustaLayer:
    """A set of cameras in one colour (or one per camera) at `/frusta/<name>`, and their path if wanted."""

    def __init__(self, scene: viser.SceneApi, name: str, color: Rgb, depth_m: float = 0.12):
        self._scene = scene
        self._name = f"/frusta/{name}"
        self._color = color
        self._depth_m = depth_m
        self._shown: tuple[object, ...] = ()
        self._handle: viser.GlbHandle | None = None
        self._visible = True

    def show(
        self,
        scan_from_camera: RigidTransform | None,
        camera: Camera | None,
        *,
        stride: int = 1,
        colors: Rgb | Floats | None = None,
        path: Floats | None = None,
    ) -> None:
        """Draw every `stride`-th of K poses of one camera; `colors` is one colour or (K, 3), else the set's own.

        `path` (N, 3) draws a line through these points, with a gap at every NaN row.
        """
        shown = (scan_from_camera, camera, stride, colors, path)
        if len(shown) == len(self._shown) and all(a is b for a, b in zip(shown, self._shown, strict=True)):
            return
        self._shown = shown
        segments, line_colors = self._lines(scan_from_camera, camera, max(1, stride), colors, path)
        if len(segments) == 0:
            if self._handle is not None:
                self._handle.remove()
                self._handle = None
            return
        glb = lines_glb(segments, line_colors).to_bytes()
        self._handle = self._scene.add_glb(
            self._name, glb, cast_shadow=False, receive_shadow=False, visible=self._visible
        )

    def set_visible(self, visible: bool) -> None:
        """Show or hide the layer."""
        self._visible = visible
        if self._handle is not None:
            self._handle.visible = visible

    def _lines(
        self,
        poses: RigidTransform | None,
        camera: Camera | None,
        stride: int,
        colors: Rgb | Floats | None,
        path: Floats | None,
    ) -> tuple[Floats, Floats]:
        """Segments (L, 2, 3) and their colours (L, 3)."""
        segments, line_colors = [np.zeros((0, 2, 3))], [np.zeros((0, 3))]
        if poses is not None and camera is not None:
            chosen = frustum_segments(poses, camera, self._depth_m)
            each = np.broadcast_to(np.asarray(self._color if colors is None else colors), (len(chosen), 3))
            segments.append(chosen[::stride].reshape(-1, 2, 3))
            line_colors.append(np.repeat(each[::stride], LINES_PER_FRUSTUM, axis=0))
        if path is not None:
            segments.append(polyline_segments(path))
            line_colors.append(np.broadcast_to(np.array(self._color, dtype=np.float64), (len(segments[-1]), 3)))
        return np.concatenate(segments), np.concatenate(line_colors)
