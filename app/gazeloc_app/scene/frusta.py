"""Camera poses as little pyramids: one node of lines per set, however many cameras there are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import viser
from scipy.spatial.transform import RigidTransform

from gazeloc_core.arrays import Bytes, Floats, Ints
from gazeloc_core.camera import Camera
from gazeloc_core.surfaces.glb import Rgb, wires_glb

EDGES: Ints = np.array([[0, 1], [0, 2], [0, 3], [0, 4], [1, 2], [2, 3], [3, 4], [4, 1], [1, 5], [5, 2]], dtype=np.int64)
"""The lines between a pyramid's points: four edges, the picture's frame, and a roof that marks its top."""
POINTS = 6
FEW_EDGES: Ints = EDGES[:5]
"""What is drawn of each of many: its four edges, and the picture's upper one, which shows how it is turned."""
MANY = 2000


@dataclass(frozen=True, eq=False)
class CameraSet:
    """K poses `scan_from_camera` of one camera, and the path (N, 3) of all that are known, a NaN row for a gap.

    Colours are sRGB (K, 3) and (N, 3), or one for all.
    """

    scan_from_camera: RigidTransform
    camera: Camera
    colors: Bytes | Rgb
    path: Floats | None = None
    path_colors: Bytes | Rgb = (0, 0, 0)


def frustum_points(scan_from_camera: RigidTransform, camera: Camera, depth_m: float) -> Floats:
    """The points (K, 6, 3) of K cameras' pyramids: the centre, the picture's corners, the top of the roof."""
    w, h = camera.width, camera.height
    corners = camera.unproject(np.array([[0, 0], [w, 0], [w, h], [0, h], [w / 2, 0]]))
    corners = depth_m * corners / corners[:, 2:]
    roof = corners[4] - 0.15 * (corners[3] - corners[0])
    in_camera = np.concatenate([np.zeros((1, 3)), corners[:4], roof[None]])
    rotations = np.reshape(scan_from_camera.rotation.as_matrix(), (-1, 3, 3))
    centers = np.reshape(scan_from_camera.translation, (-1, 1, 3))
    return np.asarray(in_camera @ rotations.transpose(0, 2, 1) + centers)


class FrustaLayer:
    """A set of cameras at `/frusta/<name>`."""

    def __init__(self, scene: viser.SceneApi, name: str, depth_m: float = 0.12):
        self._scene = scene
        self._name = f"/frusta/{name}"
        self._depth_m = depth_m
        self._shown: CameraSet | None = None
        self._handle: viser.GlbHandle | None = None
        self._visible = True

    def show(self, cameras: CameraSet | None) -> None:
        """Draw these cameras instead; None draws none."""
        if cameras is self._shown:
            return
        self._shown = cameras
        points, edges, colors = _lines(cameras, self._depth_m)
        if len(edges) == 0:
            if self._handle is not None:
                self._handle.remove()
                self._handle = None
            return
        self._handle = self._scene.add_glb(
            self._name,
            wires_glb(points, edges, colors).to_bytes(),
            cast_shadow=False,
            receive_shadow=False,
            visible=self._visible,
        )

    def set_visible(self, visible: bool) -> None:
        """Show or hide the layer."""
        self._visible = visible
        if self._handle is not None:
            self._handle.visible = visible


def _lines(cameras: CameraSet | None, depth_m: float) -> tuple[Floats, Ints, Bytes]:
    """Points (V, 3), lines (E, 2) between them, and the points' colours (V, 3)."""
    if cameras is None:
        return np.zeros((0, 3)), np.zeros((0, 2), dtype=np.int64), np.zeros((0, 3), dtype=np.uint8)
    pyramids = frustum_points(cameras.scan_from_camera, cameras.camera, depth_m)
    order = np.random.default_rng(0).permutation(len(pyramids))  # static/page/detail.js draws a part while moving
    first = POINTS * order[:, None, None]
    of_each = EDGES if len(pyramids) <= MANY else FEW_EDGES
    points, edges = pyramids.reshape(-1, 3), (first + of_each).reshape(-1, 2)
    each = np.broadcast_to(np.asarray(cameras.colors, dtype=np.uint8), (len(pyramids), 3))
    colors = np.repeat(each, POINTS, axis=0)
    if cameras.path is None:
        return points, edges, colors
    known = np.asarray(np.isfinite(cameras.path).all(axis=1))
    steps = np.flatnonzero(known[:-1] & known[1:])
    path = np.where(known[:, None], cameras.path, points[0] if len(points) else 0.0)  # a gap's point is in no line
    path_colors = np.broadcast_to(np.asarray(cameras.path_colors, dtype=np.uint8), (len(path), 3))
    return (
        np.concatenate([points, path]),
        np.concatenate([len(points) + np.column_stack([steps, steps + 1]), edges]),
        np.concatenate([colors, path_colors]),
    )
