"""COLMAP models on disk to and from `SfmModel`.

The frame `sfm` is the model's own world, of arbitrary scale. COLMAP stores `camera_from_sfm`; here it is turned round.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pycolmap
from scipy.spatial.transform import RigidTransform

from gazeloc_core.arrays import Bytes, Floats, Ints
from gazeloc_core.camera import Camera
from gazeloc_core.errors import InputError
from gazeloc_core.sfm import colmap_format as fmt
from gazeloc_core.sfm.colmap_join import join_to_recording
from gazeloc_core.sfm_model import SfmModel
from gazeloc_core.storage.user_files import about
from gazeloc_core.transforms import rigid_from_wxyz

__all__ = ["SfmModel", "find_model", "join_to_recording", "read_model", "write_model"]

REMEDY = fmt.REMEDY


def find_model(path: Path) -> Path:
    """The folder that holds a COLMAP model: `path` itself, its `sparse`, `sparse/0` or `0`.

    Raises:
        InputError: if none of them does.
    """
    if not path.is_dir():
        raise InputError.of(path, "there is no such folder", "name the folder that holds COLMAP's cameras.bin or .txt")
    for folder in (path, path / "sparse" / "0", path / "sparse", path / "0"):
        if any((folder / f"cameras.{ending}").is_file() for ending in ("bin", "txt")):
            return folder
    raise InputError.of(path, "there is no cameras.bin or cameras.txt", "name the folder of the COLMAP model")


def read_model(path: Path) -> SfmModel:
    """The COLMAP model in a folder, binary where it has both; images in the order of their ids, `frame_indices` -1.

    Raises:
        InputError: if a file is missing, cut off or garbled, or names an image, camera or point that is not there.
    """
    folder = find_model(path)
    if (folder / "cameras.bin").is_file():
        cameras = fmt.read_cameras_binary(folder / "cameras.bin")
        images = fmt.read_images_binary(folder / "images.bin")
        points = fmt.read_points_binary(folder / "points3D.bin")
    else:
        cameras = fmt.read_cameras_text(folder / "cameras.txt")
        images = fmt.read_images_text(folder / "images.txt")
        points = fmt.read_points_text(folder / "points3D.txt")
    if not images:
        raise InputError.of(folder, "the model has no images", "reconstruct again")
    return _assemble(folder, cameras, sorted(images, key=lambda image: image.image_id), points)


def _assemble(
    folder: Path, cameras: dict[int, Camera], images: list[fmt.ModelImage], points: fmt.ModelPoints
) -> SfmModel:
    _check_images(folder, cameras, images)
    if not np.isfinite(points.xyz).all():
        raise InputError.of(folder, "the model has points that are not finite", REMEDY)
    camera_from_sfm = rigid_from_wxyz(
        np.array([image.wxyz for image in images]), np.array([image.translation for image in images])
    )
    order = np.argsort(points.ids)
    which = np.concatenate([np.full(len(image.point_ids), i) for i, image in enumerate(images)])
    ids = np.concatenate([image.point_ids for image in images])
    pixels = np.concatenate([image.keypoints_px for image in images])
    seen = ids >= 0
    which, ids, pixels = which[seen], ids[seen], pixels[seen]
    index = np.searchsorted(points.ids[order], ids)
    if len(ids) and (index >= len(order)).any():
        raise InputError.of(folder, f"an image sees point {ids.max()}, which is not in points3D", REMEDY)
    if len(ids) and (points.ids[order][index] != ids).any():
        raise InputError.of(folder, "an image sees a point that is not in points3D", REMEDY)
    return SfmModel(
        cameras=cameras,
        image_names=tuple(image.name for image in images),
        image_camera_ids=np.array([image.camera_id for image in images]),
        sfm_from_camera=camera_from_sfm.inv(),
        frame_indices=np.full(len(images), -1),
        points=points.xyz[order],
        point_colors=points.rgb[order],
        point_errors_px=points.errors_px[order],
        track_lengths=points.track_lengths[order],
        observation_point=index,
        observation_image=which,
        observation_px=pixels,
    )


def _check_images(folder: Path, cameras: dict[int, Camera], images: list[fmt.ModelImage]) -> None:
    names: set[str] = set()
    for image in images:
        if image.camera_id not in cameras:
            problem = f"image {image.name} has camera {image.camera_id}, which is not in the cameras file"
            raise InputError.of(folder, problem, REMEDY)
        if image.name in names:
            raise InputError.of(folder, f"two images are called {image.name}", REMEDY)
        names.add(image.name)
        with about(folder):
            rigid_from_wxyz(image.wxyz, image.translation, f"image {image.name}")
        if not np.isfinite(image.keypoints_px).all():
            raise InputError.of(folder, f"image {image.name} has a pixel that is not finite", REMEDY)


def write_model(
    folder: Path,
    cameras: dict[int, Camera],
    image_names: tuple[str, ...],
    image_camera_ids: Ints,
    world_from_camera: RigidTransform,
    points: Floats | None = None,
    point_colors: Bytes | None = None,
) -> None:
    """Write a binary COLMAP model of posed images (K) and points (P, 3) without tracks into an existing `folder`.

    `world` is any metric or other frame; COLMAP's own world is it. Image ids are 1 to K in the order given.
    """
    model = pycolmap.Reconstruction()
    for camera_id, camera in cameras.items():
        model.add_camera_with_trivial_rig(camera.to_colmap(camera_id))
    matrices = world_from_camera.inv().as_matrix().reshape(-1, 4, 4)
    for i, (name, camera_id, matrix) in enumerate(zip(image_names, image_camera_ids, matrices, strict=True), start=1):
        image = pycolmap.Image(name=name, camera_id=int(camera_id), image_id=i)
        model.add_image_with_trivial_frame(image, pycolmap.Rigid3d(matrix[:3]))
    if points is not None:
        colors = np.full((len(points), 3), 128, np.uint8) if point_colors is None else point_colors
        for xyz, rgb in zip(points, colors, strict=True):
            model.add_point3D(xyz, pycolmap.Track(), rgb)
    model.write_binary(str(folder))
