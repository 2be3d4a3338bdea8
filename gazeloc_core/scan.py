"""A room scan: the mesh in metres, and the posed frames of the phone that made it.

The frame `scan` is the scan file's own axes, never altered; poses are `scan_from_camera` with the camera's x right,
y down, z forward. Readers in `readers/` make these types; nothing here touches a file but the images of frames.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform

from gazeloc_core.arrays import Bytes, Floats, frozen
from gazeloc_core.camera import Camera
from gazeloc_core.errors import InputError


@dataclass(frozen=True, eq=False)
class Texture:
    """Pictures on a mesh.

    `images`: RGB, each (H, W, 3) uint8. `uv_of_corner`: (F, 3, 2), u to the right and v *up* from the picture's lower
    left corner (OBJ, glTF has v down). `image_of_face`: (F,), an index into `images`, -1 for a face without picture.
    """

    images: tuple[Bytes, ...]
    uv_of_corner: NDArray[np.float32]
    image_of_face: NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles in the frame `scan`: `vertices` (V, 3) in metres, `faces` (F, 3); colours per vertex and/or a texture.

    `colors` is (V, 3) uint8 sRGB as in the scan file, or None where the file has none.
    """

    vertices: Floats
    faces: NDArray[np.int32]
    colors: Bytes | None = None
    texture: Texture | None = None

    def __post_init__(self) -> None:
        vertices, faces = frozen(self.vertices), frozen(self.faces, np.int32)
        if len(vertices) == 0 or len(faces) == 0:
            raise InputError(f"The mesh is empty ({len(vertices)} vertices, {len(faces)} faces); export it again.")
        if not np.isfinite(vertices).all():
            bad = int((~np.isfinite(vertices).all(axis=1)).sum())
            raise InputError(f"The mesh has {bad} vertices that are not finite; export it again.")
        if faces.min() < 0 or faces.max() >= len(vertices):
            wrong = int(faces.min()) if faces.min() < 0 else int(faces.max())
            raise InputError(
                f"The mesh has faces that name vertex {wrong}, but only {len(vertices)} vertices; "
                "the file is truncated, export it again."
            )
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "faces", faces)
        if self.colors is not None:
            colors = frozen(self.colors, np.uint8)
            if colors.shape != vertices.shape:
                raise InputError(f"The mesh has {len(vertices)} vertices but {len(colors)} colours.")
            object.__setattr__(self, "colors", colors)

    @property
    def has_colors(self) -> bool:
        """Whether the file brought colours, per vertex or as a texture."""
        return self.colors is not None or self.texture is not None

    @property
    def bounds(self) -> Floats:
        """Lowest and highest corner, (2, 3) in metres."""
        return np.array([self.vertices.min(axis=0), self.vertices.max(axis=0)])


@dataclass(frozen=True, eq=False)
class ScanFrame:
    """One frame of the phone: its camera (of the image as stored), pose, and files; depth is lidar, in millimetres.

    `timestamp_ns` is on the phone's own clock, which need not be Unix time.
    """

    name: str
    timestamp_ns: int
    camera: Camera
    scan_from_camera: RigidTransform
    image_path: Path | None = None
    depth_path: Path | None = None
    confidence_path: Path | None = None
    own_files: tuple[Path, ...] = ()
    """Every file of the scan's folder that belongs to this frame alone."""

    def read_image(self) -> Bytes:
        """The frame's picture, (H, W, 3) RGB.

        Raises:
            InputError: if there is no picture, it does not decode, or its size is not the camera's.
        """
        if self.image_path is None:
            raise InputError(f"Frame {self.name} has no picture.")
        return read_image(self.image_path, self.camera)

    def read_depth_m(self) -> Floats:
        """Lidar depth along the camera's z axis in metres, (h, w), NaN where missing or not of high confidence."""
        if self.depth_path is None:
            raise InputError(f"Frame {self.name} has no depth.")
        raw = cv2.imread(str(self.depth_path), cv2.IMREAD_UNCHANGED)
        if raw is None or raw.ndim != 2:
            raise InputError.of(self.depth_path, "not a depth picture", "export the scan again or remove this file")
        depth = raw.astype(np.float64) / 1000
        depth[raw == 0] = np.nan
        if self.confidence_path is not None:
            confidence = cv2.imread(str(self.confidence_path), cv2.IMREAD_UNCHANGED)
            if confidence is None or confidence.shape != raw.shape:
                raise InputError.of(
                    self.confidence_path,
                    "not a confidence picture of the depth's size",
                    "export the scan again",
                )
            depth[confidence < 2] = np.nan
        return np.asarray(depth, dtype=np.float64)


@dataclass(frozen=True, eq=False)
class RoomScan:
    """A scanned room: where it came from, its mesh, and the phone's posed frames in order of time (maybe none)."""

    path: Path
    format: str
    mesh: Mesh
    frames: tuple[ScanFrame, ...] = ()
    up_axis: str = "y"
    """The file's axis that points to the ceiling: "x", "y" or "z", with a "-" before it where it points down."""
    notes: tuple[str, ...] = ()
    """What the reader found worth saying to the user, a sentence each."""
    metres_per_unit: float = 1.0
    """What the mesh file's own coordinates were multiplied with; other programs show them as they are."""

    @property
    def frames_with_images(self) -> tuple[ScanFrame, ...]:
        """The frames that have a picture; many exports store one for only some poses."""
        return tuple(frame for frame in self.frames if frame.image_path is not None)


def read_image(path: Path, camera: Camera) -> Bytes:
    """An image file as (H, W, 3) RGB, checked against its camera's size.

    Raises:
        InputError: if the file is missing, does not decode, or has another size than the camera.
    """
    if not path.is_file():
        raise InputError.of(path, "the picture is missing", "restore it or remove the frame")
    image = cv2.imread(str(path), cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
    if image is None:
        raise InputError.of(path, "the picture does not decode", "export it again or remove the frame")
    if image.shape[:2] != (camera.height, camera.width):
        raise InputError.of(
            path,
            f"the picture is {image.shape[1]}x{image.shape[0]} but its camera {camera.width}x{camera.height}",
            "check that the calibration belongs to these frames",
        )
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2RGB), dtype=np.uint8)
