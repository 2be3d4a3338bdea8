"""A sparse reconstruction as plain columns: what pycolmap found, without pycolmap's objects.

The frame `sfm` is the reconstruction's own: arbitrary origin, axes and scale.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import RigidTransform

from gazeloc_core.arrays import Bytes, Floats, Ints, frozen
from gazeloc_core.camera import Camera
from gazeloc_core.errors import GeometryError
from gazeloc_core.transforms import Similarity, rigid_from_wxyz


@dataclass(frozen=True, eq=False)
class SfmModel:
    """K registered images and P points.

    `cameras` by id; `image_names` (K,) and `image_camera_ids` (K,); `sfm_from_camera` K poses (COLMAP's inverted);
    `frame_indices` (K,) the recording's frame of each image, -1 where the images were not joined to a recording;
    `points` (P, 3) in sfm, `point_colors` (P, 3), `point_errors_px` (P,), `track_lengths` (P,);
    observations as flat columns: `observation_point` (O,), `observation_image` (O,) and `observation_px` (O, 2).
    """

    cameras: dict[int, Camera]
    image_names: tuple[str, ...]
    image_camera_ids: Ints
    sfm_from_camera: RigidTransform
    frame_indices: Ints
    points: Floats
    point_colors: Bytes
    point_errors_px: Floats
    track_lengths: Ints
    observation_point: Ints
    observation_image: Ints
    observation_px: Floats

    def __post_init__(self) -> None:
        for name in (
            "image_camera_ids",
            "frame_indices",
            "track_lengths",
            "observation_point",
            "observation_image",
        ):
            object.__setattr__(self, name, frozen(getattr(self, name), np.int64))
        for name in ("points", "point_errors_px", "observation_px"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        object.__setattr__(self, "point_colors", frozen(self.point_colors, np.uint8))

    def __len__(self) -> int:
        return len(self.image_names)

    def camera_of(self, image: int) -> Camera:
        """The camera of the image at position `image` (0 to K-1)."""
        return self.cameras[int(self.image_camera_ids[image])]


@dataclass(frozen=True, eq=False)
class TrackedFrames:
    """T frames that are no images of a reconstruction, each with a pose from its points carried there (localize/track).

    `frame_indices` (T,) rising; `centers` (T, 3) and `wxyz` (T, 4) of `sfm_from_camera`; `points` (T,) how many points
    agree with the pose, `error_px` (T,) the median distance of these from where the pose puts them, as the lens sees.
    """

    frame_indices: Ints
    centers: Floats
    wxyz: Floats
    points: Ints
    error_px: Floats

    def __post_init__(self) -> None:
        for name in ("frame_indices", "points"):
            object.__setattr__(self, name, frozen(getattr(self, name), np.int64))
        for name in ("centers", "wxyz", "error_px"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        rows = {len(getattr(self, name)) for name in ("frame_indices", "centers", "wxyz", "points", "error_px")}
        if len(rows) > 1 or (np.diff(self.frame_indices) <= 0).any():
            raise GeometryError("Tracked frames have columns of different lengths, or are not in order.")

    def __len__(self) -> int:
        return len(self.frame_indices)

    @property
    def sfm_from_camera(self) -> RigidTransform:
        """The T poses."""
        return rigid_from_wxyz(self.wxyz, self.centers, "a pose of a tracked frame")


@dataclass(frozen=True, eq=False)
class PlacedModel:
    """A reconstruction, or a piece of one, joined to the recording's frames, and where it lies in the scan."""

    model: SfmModel
    scan_from_sfm: Similarity
    tracked: TrackedFrames | None = None
    """The frames between its images, where they were tracked."""
