"""The box room with observations: every point knows the images that truly see it, and where in them."""

from dataclasses import replace

import numpy as np
from box_room import PINHOLE, Room, make_room
from scipy.spatial.transform import RigidTransform

from gazeloc_core.surfaces.raycast import Raycaster


def sighted_room(**arguments) -> Room:
    """`make_room` with a column of observations; colours are the places in the scan, so that they can be checked."""
    room = make_room(**arguments)
    raycaster = Raycaster(room.mesh)
    in_scan = room.scan_from_sfm.apply(room.model.points)
    point, image, pixels = [], [], []
    for k in range(len(room.model)):
        pose = room.scan_from_camera[k]
        seen = PINHOLE.project(pose.inv().apply(in_scan))
        ray = in_scan - pose.translation
        reach = raycaster.cast(np.broadcast_to(pose.translation, ray.shape), ray).distance
        rows = np.flatnonzero(PINHOLE.contains(seen) & (reach > 0.97))
        point.append(rows)
        image.append(np.full(len(rows), k))
        pixels.append(seen[rows])
    colors = np.clip(128 + 40 * in_scan, 0, 255).astype(np.uint8)
    model = replace(
        room.model,
        point_colors=colors,
        observation_point=np.concatenate(point),
        observation_image=np.concatenate(image),
        observation_px=np.concatenate(pixels),
    )
    return replace(room, model=model)


def looking_at(target, stand, up=(0.0, 1.0, 0.0)) -> RigidTransform:
    """The pose of a camera at `stand` (3,) whose picture has `target` (3,) in its middle."""
    forward = np.subtract(target, stand) / np.linalg.norm(np.subtract(target, stand))
    right = np.cross(forward, up if abs(forward @ up) < 0.95 else (1.0, 0.0, 0.0))
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, :3] = np.column_stack([right, np.cross(forward, right), forward])
    matrix[:3, 3] = stand
    return RigidTransform.from_matrix(matrix)
