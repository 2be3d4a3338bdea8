"""Pictures of a single tag on a wall, for measuring what the detector makes of it.

A plane needs no ray tracer: every sample of a pixel goes through the exact homography to a cell of the tag, so that the
picture is right at any distance and angle. Then the lens blurs, the moving head smears, and the sensor adds its noise,
as in `glasses.py`. Pictures are of the undistorted camera, cut to the tag's surroundings; lens distortion and video
compression are left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.spatial.transform import RigidTransform

from gazeloc_core.arrays import Bytes, Floats, frozen
from gazeloc_core.camera import Camera
from gazeloc_core.synthesis.glasses import noisy
from gazeloc_core.synthesis.textures import linear
from gazeloc_core.synthesis.textures import noise as smooth_noise
from gazeloc_core.tags.bitmaps import TagBitmap
from gazeloc_core.tags.square import UNIT_SQUARE

PAPER, INK, WALL = 236.0, 22.0, 165.0
"""sRGB of what is seen, in full light."""
_SAMPLES_PER_CELL = 14.0
_LIGHT_GRID_PX = 6


@dataclass(frozen=True, kw_only=True)
class SightOptions:
    """What a picture of a tag suffers from. The defaults give detected corners the errors of the sample scene's."""

    paper_grey: float = 150.0
    """How bright the tag's white paper comes out, 0 to 255."""
    blur_px: float = 0.45
    """Standard deviation of the lens's blur."""
    motion_px: float = 8.0
    """The longest path that the picture moves while it is exposed: in the median a quarter of this, in one picture of
    ten more than 0.8."""
    margin: float = 0.3
    """Wall shown around the tag's paper, as a share of its size in the picture."""


@dataclass(frozen=True, eq=False)
class TagSight:
    """A picture (h, w) grey, where its upper left corner lies in the camera's picture (2,), the true corners (4, 2)."""

    image: Bytes
    offset_px: Floats
    corners_px: Floats

    def __post_init__(self) -> None:
        for name in ("image", "offset_px", "corners_px"):
            object.__setattr__(self, name, frozen(getattr(self, name), getattr(self, name).dtype))


def tag_sight(
    bitmap: TagBitmap,
    camera: Camera,
    camera_from_tag: RigidTransform,
    size_m: float,
    rng: np.random.Generator,
    options: SightOptions | None = None,
) -> TagSight:
    """One picture of a tag by a pinhole camera; the tag may reach out of the camera's picture, which is then larger."""
    options = options or SightOptions()
    unit = np.column_stack([UNIT_SQUARE, np.zeros(4)]) * size_m
    corners = camera.project(camera_from_tag.apply(unit))
    paper = camera.project(camera_from_tag.apply(unit * len(bitmap.is_white) / bitmap.across))
    reach = options.margin * np.ptp(paper, axis=0).max() + 8
    low, high = np.floor(paper.min(axis=0) - reach), np.ceil(paper.max(axis=0) + reach)
    width, height = (high - low).astype(int).tolist()
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1)
    per_pixel = int(np.clip(np.ceil(_SAMPLES_PER_CELL * bitmap.across / sides.min()), 4, 12))
    albedo = _seen(bitmap, _cells_from_px(bitmap, camera, camera_from_tag, size_m), low, (height, width), per_pixel)
    radiance = albedo * _light(height, width, rng)
    blurred = cv2.GaussianBlur(radiance.astype(np.float32), (0, 0), options.blur_px)
    smeared = cv2.filter2D(blurred, -1, _path(options.motion_px, rng), borderType=cv2.BORDER_REPLICATE)
    gain = float(linear(options.paper_grey) / linear(PAPER))
    return TagSight(noisy(smeared, gain, rng), low, corners)


def _cells_from_px(bitmap: TagBitmap, camera: Camera, camera_from_tag: RigidTransform, size_m: float) -> Floats:
    """The homography (3, 3) from the camera's pixels to columns and rows of the bitmap's cells."""
    plane = np.column_stack([camera_from_tag.rotation.as_matrix()[:, :2], camera_from_tag.translation])
    cells = bitmap.across / size_m
    middle = len(bitmap.is_white) / 2
    cells_from_tag = np.array([[cells, 0, middle], [0, cells, middle], [0, 0, 1]])
    return np.asarray(cells_from_tag @ np.linalg.inv(camera.matrix @ plane))


def _seen(bitmap: TagBitmap, cells_from_px: Floats, low: Floats, shape: tuple[int, int], per_pixel: int) -> Floats:
    """The mean albedo (h, w) of each pixel over `per_pixel`² samples."""
    albedo = np.where(bitmap.is_white, linear(PAPER), linear(INK))
    around = 0 if bitmap.is_size_outer else 1  # a white margin, where the bitmap brings none
    albedo = np.pad(albedo, around, constant_values=float(linear(PAPER)))
    albedo = np.pad(albedo, 1, constant_values=float(linear(WALL)))
    height, width = shape
    x = low[0] + (np.arange(width * per_pixel) + 0.5) / per_pixel
    total = np.empty(shape)
    for row in range(height):  # a row of pixels at a time keeps the samples in the cache
        y = low[1] + row + (np.arange(per_pixel)[:, None] + 0.5) / per_pixel
        column, line, depth = (h[0] * x + (h[1] * y + h[2]) for h in cells_from_px)
        i = np.clip(np.floor(line / depth) + around + 1, 0, len(albedo) - 1).astype(np.intp)
        j = np.clip(np.floor(column / depth) + around + 1, 0, len(albedo) - 1).astype(np.intp)
        total[row] = albedo[i, j].reshape(per_pixel, width, per_pixel).mean(axis=(0, 2))
    return total


def _light(height: int, width: int, rng: np.random.Generator) -> Floats:
    """Uneven light (h, w) around 1: a gradient over the wall, and the wall's own faint clouds."""
    coarse = 1 + np.array([height, width]) // _LIGHT_GRID_PX
    y, x = np.mgrid[: coarse[0], : coarse[1]] / coarse.max()
    slope = rng.normal(0, 0.12, 2)
    clouds = smooth_noise(3 * x, 3 * y, int(rng.integers(1 << 30)), 3)
    light = 1 + slope[0] * (x - 0.5) + slope[1] * (y - 0.5) + 0.03 * clouds
    return np.asarray(cv2.resize(light, (width, height), interpolation=cv2.INTER_LINEAR))


def _path(longest_px: float, rng: np.random.Generator) -> Floats:
    """The kernel (n, n) of a straight path through the middle, in a random direction, mostly far shorter."""
    direction, length = rng.uniform(0, np.pi), longest_px * rng.uniform() ** 2
    steps = (np.arange(64) + 0.5) / 64 - 0.5
    half = int(np.ceil(longest_px / 2)) + 1
    kernel = np.zeros((2 * half + 1, 2 * half + 1))
    for x, y in half + length * np.outer(steps, [np.cos(direction), np.sin(direction)]):
        i, j = int(y), int(x)
        kernel[i : i + 2, j : j + 2] += np.outer([1 - y + i, y - i], [1 - x + j, x - j])
    return np.asarray(kernel / kernel.sum())
