"""The points of a reconstruction that are carried from one of its images, and where the lens sees them."""

from __future__ import annotations

import numpy as np

from gazeloc_core.arrays import Floats, Ints
from gazeloc_core.camera import Camera
from gazeloc_core.frames.undistort import project_valid
from gazeloc_core.sfm_model import SfmModel

_OFF_PX = 4.0
"""A point that the reconstruction itself puts this far from where the image shows it is not carried."""


class ImagePoints:
    """For each image of a model the points to carry: those that it shows, at most `count`, spread over the picture."""

    def __init__(self, model: SfmModel, camera: Camera, count: int):
        """`camera` is the distorted one of the recording."""
        self._model, self._camera, self._count = model, camera, count
        self._order = np.argsort(model.observation_image, kind="stable")
        self._starts = np.searchsorted(model.observation_image[self._order], np.arange(len(model) + 1))

    def of(self, image: int) -> tuple[Ints, Floats]:
        """Rows (M,) of the model's points, and their pixels (M, 2) in the distorted picture by the model's own pose."""
        model = self._model
        rows = self._order[self._starts[image] : self._starts[image + 1]]
        points = model.observation_point[rows]
        pose = model.sfm_from_camera[image]
        in_camera = (model.points[points] - pose.translation) @ pose.rotation.as_matrix()
        with np.errstate(invalid="ignore"):
            off_px = np.linalg.norm(model.camera_of(image).project(in_camera) - model.observation_px[rows], axis=1)
            pixels = project_valid(self._camera, in_camera)
            usable = (off_px <= _OFF_PX) & self._camera.contains(pixels)
        points, pixels = points[usable], pixels[usable]
        chosen = spread(pixels / [self._camera.width, self._camera.height], model.track_lengths[points], self._count)
        return points[chosen], pixels[chosen]


def spread(places: Floats, worth: Ints, count: int) -> Ints:
    """At most `count` rows of `places` (N, 2), 0 to 1: first each cell's best by `worth` (N,), then its second, ..."""
    if len(places) <= count:
        return np.arange(len(places), dtype=np.int64)
    side = int(np.ceil(np.sqrt(count / 2)))  # cells that hold two points each where points are everywhere
    column, row = np.clip(np.floor(places * side).astype(np.int64), 0, side - 1).T
    cell = row * side + column
    order = np.lexsort((-worth, cell))
    starts = np.flatnonzero(np.diff(cell[order], prepend=-1))
    rank = np.empty(len(places), dtype=np.int64)
    rank[order] = np.arange(len(places)) - np.repeat(starts, np.diff(starts, append=len(places)))
    return np.sort(np.argsort(rank, kind="stable")[:count])
