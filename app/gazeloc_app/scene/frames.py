"""One frame of the recording in the scene: its camera, and its picture to look and click through."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import viser
from scipy.spatial.transform import RigidTransform

from gazeloc_app.palette import SHOWN_FRAME
from gazeloc_app.scene.placing import pose_arguments
from gazeloc_core.arrays import Bytes, Floats
from gazeloc_core.camera import Camera

_DEPTH_M = 0.3
"""Height of the pyramid of the frame that is looked at."""
PLANE_M = 0.5
"""Distance from the camera at which its picture stands in the scene."""


class SelectedFrameLayer:
    """The frame that is looked at, as one real frustum with its picture, at `/selected`."""

    def __init__(self, scene: viser.SceneApi):
        self._scene = scene
        self._shown: tuple[object, ...] = ()
        self._handle: viser.CameraFrustumHandle | None = None
        self._visible = True

    def show(self, scan_from_camera: RigidTransform | None, camera: Camera | None, image: Bytes | None = None) -> None:
        """Draw the pinhole `camera` at this pose, with its picture (a small one will do); None draws none."""
        shown = (scan_from_camera, camera, image)
        if len(self._shown) == 3 and all(a is b for a, b in zip(shown, self._shown, strict=True)):
            return
        self._shown = shown
        if scan_from_camera is None or camera is None:
            if self._handle is not None:
                self._handle.remove()
                self._handle = None
            return
        wxyz, position = pose_arguments(scan_from_camera)
        self._handle = self._scene.add_camera_frustum(
            "/selected",
            fov=vertical_fov_rad(camera),
            aspect=camera.width / camera.height * camera.focal_px[1] / camera.focal_px[0],
            scale=_DEPTH_M,
            color=SHOWN_FRAME,
            thickness=2.0,
            thickness_units="screen",
            image=image,
            wxyz=wxyz,
            position=position,
            visible=self._visible,
            cast_shadow=False,
            receive_shadow=False,
        )

    def set_visible(self, visible: bool) -> None:
        """Show or hide the layer."""
        self._visible = visible
        if self._handle is not None:
            self._handle.visible = visible


class FrameInSceneLayer:
    """A frame's picture standing before its camera at `/picture`, exactly where the scene appears behind it.

    Use it on one client's scene while that client looks through the camera (`look_through`): an ordinary click on the
    scene is then a click on the frame (`picking.pixel_in_frame`).
    """

    def __init__(self, scene: viser.SceneApi):
        self._scene = scene
        self._handle: viser.ImageHandle | None = None

    def show(self, scan_from_camera: RigidTransform | None, camera: Camera | None, image: Bytes | None) -> None:
        """Stand the (undistorted) picture before the pinhole `camera`; None takes it away."""
        if scan_from_camera is None or camera is None or image is None:
            if self._handle is not None:
                self._handle.remove()
                self._handle = None
            return
        wxyz, _ = pose_arguments(scan_from_camera)
        width, height, centre_in_camera = picture_plane(camera)
        position = scan_from_camera.apply(np.array(centre_in_camera))
        self._handle = self._scene.add_image(
            "/picture",
            image,
            render_width=width,
            render_height=height,
            format="jpeg",
            jpeg_quality=90,
            wxyz=wxyz,
            position=position,
            cast_shadow=False,
            receive_shadow=False,
        )


@dataclass(frozen=True, eq=False)
class View:
    """What a viewer's camera is set to: place, `wxyz` (x right, y down, z forward) and vertical field of view."""

    position: Floats
    wxyz: Floats
    fov_rad: float


def look_through(scan_from_camera: RigidTransform, camera: Camera, aspect: float = np.inf) -> View:
    """The view that shows what the camera saw, some 15 % wider, so that the picture's edges are seen.

    `aspect` is the view's width by its height: a narrow one takes a larger vertical angle to show the whole picture.
    """
    wxyz, position = pose_arguments(scan_from_camera)
    half_height, half_width = np.array([camera.height, camera.width]) / 2 / np.array(camera.focal_px)[::-1]
    return View(position, wxyz, 2 * float(np.arctan(1.15 * max(half_height, half_width / max(aspect, 0.1)))))


def vertical_fov_rad(camera: Camera) -> float:
    """The vertical angle of a pinhole camera's picture, as if its principal point were in the middle."""
    return 2 * float(np.arctan(camera.height / 2 / camera.focal_px[1]))


def picture_plane(camera: Camera, plane_m: float = PLANE_M) -> tuple[float, float, Floats]:
    """Width, height and centre (3,) in the camera of a pinhole camera's picture at the distance `plane_m`."""
    (fx, fy), (cx, cy) = camera.focal_px, camera.principal_point_px
    size = np.array([camera.width / fx, camera.height / fy]) * plane_m
    centre = np.array([(camera.width / 2 - cx) / fx, (camera.height / 2 - cy) / fy, 1.0]) * plane_m
    return float(size[0]), float(size[1]), centre
