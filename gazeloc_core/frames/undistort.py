"""From the distorted scene camera to a pinhole camera: pictures and pixels, both ways.

The pinhole keeps the focal length of the lens at its centre, so that no detail of the middle is lost, and grows to the
sides, where the lens compresses: an 82° lens of 1088x1080 pixels becomes about 1320x1310. A rational lens model is
only meant for the rays inside the picture; further out it folds back and claims pixels for rays that the lens never
saw. Such rays are found (`valid_radius`) and left black, such pixels are NaN.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import cv2
import numpy as np
from numpy.typing import ArrayLike

from gazeloc_core.arrays import Bytes, Floats
from gazeloc_core.camera import HALF_PIXEL, Camera
from gazeloc_core.errors import InputError

ROUND_TRIP_PX = 0.05
"""A pixel whose ray comes back further away than this has no ray."""

_OUTSIDE = -10.0
_AZIMUTHS = 64
_STEPS = 600
_WIDEST = np.tan(np.radians(80.0))
_EDGE_POINTS = 33
_LARGEST_PX = 8192


class Coverage(StrEnum):
    """How much of the distorted picture the pinhole picture shows."""

    INSIDE = "inside"
    """Crop: no black borders, the largest centred rectangle that the lens fills."""
    EDGES = "edges"
    """Keep the middle of every edge; the far corners are lost, a lens that stretches its corners leaves black ones."""
    WHOLE = "whole"
    """Keep every pixel; large black borders and stretched corners."""


@dataclass(frozen=True, kw_only=True)
class UndistortOptions:
    """What the pinhole picture looks like."""

    coverage: Coverage = Coverage.EDGES
    """How much of the distorted picture is kept: inside (crop), edges, or whole."""
    focal_scale: float = 1.0
    """Focal length as a share of the lens's at its centre; below 1 makes smaller pictures with less detail."""


def valid_radius(camera: Camera) -> float:
    """The largest tan(angle to the optical axis) up to which the lens model still maps further out to further out.

    Sampled along 64 directions up to 80°; a pinhole gives tan(80°).
    """
    azimuth = np.linspace(0, 2 * np.pi, _AZIMUTHS, endpoint=False)
    radius = np.linspace(0, _WIDEST, _STEPS)
    ray = np.empty((_AZIMUTHS, _STEPS, 3))
    ray[..., 0] = np.cos(azimuth)[:, None] * radius
    ray[..., 1] = np.sin(azimuth)[:, None] * radius
    ray[..., 2] = 1
    offset = camera.project(ray.reshape(-1, 3)) - camera.principal_point_px
    distance = np.linalg.norm(offset / camera.focal_px, axis=1).reshape(_AZIMUTHS, _STEPS)
    grows = np.diff(distance, axis=1) > 0  # False for NaN too
    last = np.where(grows.all(axis=1), _STEPS - 1, grows.argmin(axis=1))
    return float(radius[last.min()])


def _rays_of_edges(camera: Camera) -> Floats:
    """Normalised image points (4, n, 2) of the left, right, top and bottom edge."""
    t = np.linspace(0, 1, _EDGE_POINTS)
    w, h = camera.width, camera.height
    edges = [np.column_stack(xy) for xy in ((0 * t, t * h), (0 * t + w, t * h), (t * w, 0 * t), (t * w, 0 * t + h))]
    rays = unproject_checked(camera, np.concatenate(edges))
    return (rays[:, :2] / rays[:, 2:]).reshape(4, _EDGE_POINTS, 2)


def unproject_checked(camera: Camera, pixels: ArrayLike) -> Floats:
    """Unit rays (N, 3) of pixels (N, 2); NaN where the lens model has no ray that really projects there."""
    px = np.asarray(pixels, dtype=np.float64).reshape(-1, 2)
    rays = np.full((len(px), 3), np.nan)
    finite = np.isfinite(px).all(axis=1)
    if not finite.any():
        return rays
    found = camera.unproject(px[finite])
    if not camera.is_pinhole:
        with np.errstate(invalid="ignore"):
            back = np.linalg.norm(camera.project(np.nan_to_num(found, nan=-1.0)) - px[finite], axis=1)
            radius = np.linalg.norm(found[:, :2], axis=1) / found[:, 2]
            found[~((back <= ROUND_TRIP_PX) & (radius <= valid_radius(camera)))] = np.nan
    rays[finite] = found
    return rays


def _reach(outward: Floats, coverage: Coverage) -> float:
    """How far the picture reaches on one side, from the outward coordinates (n,) of that edge's points."""
    if coverage is Coverage.EDGES:
        return float(outward[_EDGE_POINTS // 2])
    return float(outward.max() if coverage is Coverage.WHOLE else outward.min())  # NaN stays NaN


def undistorted_camera(camera: Camera, options: UndistortOptions | None = None) -> Camera:
    """The pinhole camera for the pictures of `camera`, same optical axis; a pinhole camera is returned as it is.

    Raises:
        InputError: if the lens model does not even cover its own picture, or the answer would be absurdly large.
    """
    options = options or UndistortOptions()
    if camera.is_pinhole:
        return camera
    if not 0.05 <= options.focal_scale <= 4:
        raise InputError(f"The focal scale is {options.focal_scale}; it must lie between 0.05 and 4.")
    left, right, top, bottom = _rays_of_edges(camera)
    x0, x1 = -_reach(-left[:, 0], options.coverage), _reach(right[:, 0], options.coverage)
    y0, y1 = -_reach(-top[:, 1], options.coverage), _reach(bottom[:, 1], options.coverage)
    if not (np.isfinite([x0, x1, y0, y1]).all() and x0 < 0 < x1 and y0 < 0 < y1):
        raise InputError(
            f"The lens model {camera.model} does not cover its {camera.width}x{camera.height} pictures; "
            "check the distortion coefficients and their order."
        )
    fx, fy = camera.focal_px * options.focal_scale
    width, height = (int(np.ceil(size)) for size in ((x1 - x0) * fx, (y1 - y0) * fy))
    if max(width, height) > _LARGEST_PX:
        raise InputError(
            f"Undistorted pictures would be {width}x{height} pixels; "
            "choose the coverage 'edges' or a smaller focal scale."
        )
    return Camera.pinhole(width, height, fx, fy, -x0 * fx, -y0 * fy)


class Undistorter:
    """Pictures and pixels of a distorted `source` camera in a pinhole `target` camera and back; maps are made once."""

    def __init__(self, source: Camera, target: Camera):
        self.source, self.target = source, target
        self._is_same = source.is_pinhole and source.to_json() == target.to_json()
        self._maps = None if self._is_same else _maps(source, target)

    @classmethod
    def of(cls, source: Camera, options: UndistortOptions | None = None) -> Undistorter:
        """The undistorter from `source` to `undistorted_camera(source, options)`."""
        return cls(source, undistorted_camera(source, options))

    def image(self, rgb: Bytes) -> Bytes:
        """The picture (H, W, 3) of the source as the target sees it, black where the source saw nothing.

        Raises:
            InputError: if the picture's size is not the source's.
        """
        height, width = self.source.height, self.source.width
        if rgb.shape[:2] != (height, width):
            raise InputError(
                f"The picture is {rgb.shape[1]}x{rgb.shape[0]} but its camera {width}x{height}; "
                "check that the calibration belongs to these frames."
            )
        if self._maps is None:
            return rgb
        return np.asarray(cv2.remap(rgb, *self._maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT), np.uint8)

    def pixels_to_undistorted(self, pixels: ArrayLike) -> Floats:
        """Pixels (N, 2) of the source in the target; NaN where the lens model has no ray."""
        return self.target.project(unproject_checked(self.source, pixels))

    def pixels_to_distorted(self, pixels: ArrayLike) -> Floats:
        """Pixels (N, 2) of the target in the source; NaN where the lens never saw the ray."""
        return project_valid(self.source, self.target.unproject(pixels))


def project_valid(camera: Camera, rays: Floats) -> Floats:
    """Pixels (N, 2) of rays (N, 3), NaN beyond the lens model's valid radius."""
    pixels = camera.project(rays)
    if not camera.is_pinhole:
        with np.errstate(invalid="ignore"):
            pixels[~(np.linalg.norm(rays[:, :2], axis=1) <= valid_radius(camera) * rays[:, 2])] = np.nan
    return pixels


def _maps(source: Camera, target: Camera) -> tuple[Bytes, Bytes]:
    """OpenCV's fixed-point maps: for each target pixel its place in the source, first pixel centre at (0, 0)."""
    pixels = project_valid(source, target.unproject(target.pixel_centres()))
    places = np.where(np.isfinite(pixels), pixels - HALF_PIXEL, _OUTSIDE)
    places = np.clip(places, _OUTSIDE, max(source.width, source.height) + 10)
    maps = places.astype(np.float32).reshape(target.height, target.width, 2)
    return cv2.convertMaps(maps, None, cv2.CV_16SC2)
