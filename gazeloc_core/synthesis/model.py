"""The COLMAP model that comes with a made-up recording: as if its owner had run COLMAP on undistorted frames.

It is made by the project's own reconstruction from the written video, every so many frames, on one thread so that the
same scene gives the same model; points seen by few images and features without a point are left out, as they only
make the files large.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pycolmap

from gazeloc_core.frames.undistort import Undistorter
from gazeloc_core.progress import Report, part, silent
from gazeloc_core.readers import open_recording
from gazeloc_core.sfm.reconstruction import SfmOptions, reconstruct

MAX_FEATURES = 2500
LEAST_SIGHTINGS = 3


def write_model(recording_folder: Path, folder: Path, stride: int, seed: int, report: Report = silent) -> None:
    """Write cameras, images, points, rigs and frames (binary) of the largest model to `folder`.

    Image names end in the frame's number in the recording.
    """
    recording = open_recording(recording_folder)
    undistorter = Undistorter.of(recording.camera)
    indices = list(range(0, len(recording), stride))
    names = [f"frame_{index:06d}.jpg" for index in indices]
    with tempfile.TemporaryDirectory() as temporary:
        images, work = Path(temporary) / "images", Path(temporary) / "work"
        images.mkdir()
        for name, (_, rgb) in zip(names, recording.frames.iterate(indices), strict=True):
            picture = undistorter.image(rgb)[..., ::-1]
            cv2.imwrite(str(images / name), picture, [cv2.IMWRITE_JPEG_QUALITY, 95])
        options = SfmOptions(max_features=MAX_FEATURES, threads=1, seed=seed, least_views=2)  # as it was committed
        reconstruct(images, names, undistorter.target, np.array(indices), work, options, part(report, 0.1, 1.0))
        found = [pycolmap.Reconstruction(p) for p in sorted((work / "models").iterdir())]
    folder.mkdir(parents=True, exist_ok=True)
    _slim(max(found, key=lambda model: int(model.num_reg_images()))).write_binary(str(folder))


def _slim(model: Any) -> Any:
    """The model without points that too few images saw, and without the features that belong to no point."""
    slim = pycolmap.Reconstruction()
    for camera in model.cameras.values():
        slim.add_camera_with_trivial_rig(camera)
    place: dict[tuple[int, int], int] = {}
    wanted = {key for key, point in model.points3D.items() if point.track.length() >= LEAST_SIGHTINGS}
    for image_id in sorted(model.reg_image_ids()):
        image = model.images[image_id]
        kept = [k for k, point in enumerate(image.points2D) if point.has_point3D() and point.point3D_id in wanted]
        place |= {(image_id, old): new for new, old in enumerate(kept)}
        pixels = np.array([image.points2D[k].xy for k in kept]).reshape(-1, 2)
        copy = pycolmap.Image(name=image.name, keypoints=pixels, camera_id=image.camera_id, image_id=image_id)
        slim.add_image_with_trivial_frame(copy, image.cam_from_world())
    for point_id in sorted(wanted):
        point = model.points3D[point_id]
        track = pycolmap.Track()
        for element in point.track.elements:
            track.add_element(element.image_id, place[element.image_id, element.point2D_idx])
        slim.add_point3D(point.xyz, track, point.color)
    slim.update_point_3d_errors()
    return slim
