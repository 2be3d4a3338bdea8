"""Tags drawn into a frame (the paper's figure 2): outline, id, axes, and a cube that stands on the tag.

Lines are bright on a dark rim, so that they show on dim pictures as on bright ones. What is drawn from a pose is
projected point by point through the camera, so that it is right in distorted frames too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.spatial.transform import RigidTransform

from gazeloc_core.arrays import Bytes, Floats
from gazeloc_core.camera import HALF_PIXEL, Camera
from gazeloc_core.tag_types import TagSightings
from gazeloc_core.tags.pose import apriltag_poses
from gazeloc_core.tags.square import UNIT_SQUARE
from gazeloc_core.transforms import rigid, rotation_from_matrix

OUTLINE = (255, 255, 255)
FIRST_CORNER = (255, 40, 210)
CUBE = (255, 200, 25)
AXES = ((225, 55, 45), (70, 250, 145), (90, 105, 255))
"""Colours of x, y and z; told apart by colour-blind eyes too, and from the others (tests/app/test_palette.py)."""

_RIM = (10, 10, 10)
_SHIFT = 6  # OpenCV draws on 1/64 of a pixel
_STEPS = 12
_FAR_PX = 4096.0
_FOOT = np.column_stack([UNIT_SQUARE, np.zeros(4)])
_TOP = _FOOT - [0.0, 0.0, 1.0]  # z goes into the wall
_CUBE_EDGES = np.concatenate([np.stack([_FOOT, _TOP], axis=1), np.stack([_TOP, np.roll(_TOP, -1, axis=0)], axis=1)])
_AXES = np.stack([np.zeros((3, 3)), 0.5 * np.eye(3)], axis=1)

Color = tuple[int, int, int]


@dataclass(frozen=True, kw_only=True)
class DrawingOptions:
    """What is drawn of a tag."""

    axes: bool = True
    """Its axes: x red, y green, z blue (into the wall)."""
    cube: bool = True
    """A cube of the tag's size that stands on it."""
    label: bool = True
    """Its id."""
    width_px: float | None = None
    """Width of the lines; by default a 500th of the picture's height, 1 at least."""


@dataclass(frozen=True, eq=False)
class DrawnTag:
    """A tag of a frame: its id, its corners (4, 2) as detected, and its pose `camera_from_tag` where it has one."""

    tag_id: int
    corners_px: Floats
    camera_from_tag: RigidTransform | None = None


def drawn_tags(sightings: TagSightings, frame: int, camera: Camera, size_m: float | None) -> list[DrawnTag]:
    """The tags of one frame, with their poses where the size is known, ready to be drawn (figure 2)."""
    mine = sightings.pick(np.flatnonzero(sightings.frame_index == frame))
    if size_m is None or len(mine) == 0:
        return [DrawnTag(int(i), corners) for i, corners in zip(mine.tag_id, mine.corners_px, strict=True)]
    poses = apriltag_poses(mine.corners_px, camera, size_m)
    return [
        DrawnTag(int(mine.tag_id[i]), mine.corners_px[i], _pose(poses.rotation[i, 0], poses.translation[i, 0]))
        for i in range(len(mine))
    ]


def _pose(rotation: Floats, translation: Floats) -> RigidTransform | None:
    if not (np.isfinite(rotation).all() and np.isfinite(translation).all()):
        return None
    return rigid(rotation_from_matrix(rotation, "a tag's rotation"), translation, "pose of a tag")


def draw_tags(
    image: Bytes, tags: Sequence[DrawnTag], camera: Camera, size_m: float | None, options: DrawingOptions | None = None
) -> Bytes:
    """A copy of the picture (H, W, 3) RGB with tags of size `size_m` drawn in; `camera` is the picture's own.

    Axes and cube need a pose and a size; without them there are outline and id.
    """
    options = options or DrawingOptions()
    width = options.width_px or max(1.0, image.shape[0] / 500)
    pen = _Pen(np.ascontiguousarray(image).copy(), width)
    for tag in tags:
        edges: list[tuple[Floats, Color]] = []
        if tag.camera_from_tag is not None and size_m is not None:
            in_space = _Projected(camera, tag.camera_from_tag, size_m)
            edges += [(in_space(edge), CUBE) for edge in _CUBE_EDGES if options.cube]
            edges += [(in_space(edge), color) for edge, color in zip(_AXES, AXES, strict=True) if options.axes]
        for pixels, color in edges:
            pen.line(pixels, color)
        pen.line(np.vstack([tag.corners_px, tag.corners_px[:1]]), OUTLINE)
        pen.dot(tag.corners_px[0], FIRST_CORNER)
    if options.label:
        for tag in tags:  # above all lines
            pen.label(str(tag.tag_id), tag.corners_px)
    return pen.image


class _Projected:
    """Straight edges in units of the tag's size, to the picture."""

    def __init__(self, camera: Camera, camera_from_tag: RigidTransform, size_m: float):
        self._camera, self._pose, self._size = camera, camera_from_tag, size_m

    def __call__(self, edge: Floats) -> Floats:
        """Pixels (n, 2) along the edge (2, 3); NaN behind the camera."""
        share = np.linspace(0, 1, _STEPS)[:, None]
        points = (1 - share) * edge[0] + share * edge[1]
        return self._camera.project(self._pose.apply(points * self._size))


class _Pen:
    """Draws on one picture, antialiased; pixels are ours, the first centre at (0.5, 0.5)."""

    def __init__(self, image: Bytes, width_px: float):
        self.image = image
        self._width = max(1, round(width_px))

    def line(self, pixels: Floats, color: Color) -> None:
        """A line through pixels (n, 2), left out where they are NaN or far outside."""
        near = np.asarray((np.abs(pixels) < _FAR_PX).all(axis=1))  # NaN is not
        runs = np.split(np.arange(len(pixels)), np.flatnonzero(~near))
        paths = [_fixed(pixels[run[near[run]]]) for run in runs]
        for shade, width in ((_RIM, self._width + 2), (color, self._width)):
            cv2.polylines(self.image, [p for p in paths if len(p) > 1], False, shade, width, cv2.LINE_AA, _SHIFT)

    def dot(self, pixel: Floats, color: Color) -> None:
        """A filled spot."""
        x, y = _fixed(pixel).tolist()
        for shade, radius in ((_RIM, 2 * self._width + 1), (color, 2 * self._width)):
            cv2.circle(self.image, (x, y), radius << _SHIFT, shade, -1, cv2.LINE_AA, _SHIFT)

    def label(self, text: str, corners_px: Floats) -> None:
        """A word under a tag's corners (4, 2), kept inside the picture."""
        scale = 0.35 + 0.2 * self._width
        (w, h), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_DUPLEX, scale, 1)
        room = np.array([self.image.shape[1] - w - 2, self.image.shape[0] - 2])
        under = np.array([corners_px[:, 0].mean() - w / 2, corners_px[:, 1].max() + h + 3 * self._width])
        x, y = np.clip(np.rint(under), [2, h + 2], np.maximum(room, [2, h + 2])).astype(int)
        for shade, width in ((_RIM, 2 + 2 * self._width), ((255, 255, 255), self._width)):
            cv2.putText(self.image, text, (int(x), int(y)), cv2.FONT_HERSHEY_DUPLEX, scale, shade, width, cv2.LINE_AA)


def _fixed(pixels: Floats) -> np.ndarray[tuple[int, ...], np.dtype[np.int32]]:
    """Pixels in OpenCV's fixed point and convention, where the first centre is (0, 0)."""
    return np.asarray(np.rint((pixels - HALF_PIXEL) * (1 << _SHIFT)), dtype=np.int32)
