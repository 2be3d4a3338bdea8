"""Pictures of a textured corner of a room, drawn by hand, for reconstructions that take seconds."""

from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from gazeloc_core.camera import Camera

CAMERA = Camera.pinhole(320, 240, 260, 260, 160, 120)


def write_room(folder: Path, count: int = 8) -> list[str]:
    """Pictures of a textured corner of a room (three planes), from a camera that moves to the side and turns."""
    rng = np.random.default_rng(0)
    texture = [cv2.resize(rng.integers(0, 255, (90, 90), dtype=np.uint8), (900, 900)) for _ in range(3)]
    names = []
    rays = CAMERA.unproject(CAMERA.pixel_centres())
    for i in range(count):
        turn = Rotation.from_euler("y", -20 + 40 * i / (count - 1), degrees=True).as_matrix()
        centre = np.array([1.2 * i / (count - 1) - 0.6, 0.1 * np.sin(i), 0.0])
        directions = rays @ turn.T
        picture, nearest = np.zeros(len(rays)), np.full(len(rays), np.inf)
        for axis, place, image in ((2, 2.5, texture[0]), (0, 1.8, texture[1]), (1, 1.0, texture[2])):
            with np.errstate(divide="ignore", invalid="ignore"):
                t = (place - centre[axis]) / directions[:, axis]
            hit = (t > 0) & (t < nearest)
            points = centre + t[hit, None] * directions[hit]
            u, v = (np.delete(points, axis, axis=1) * 150 + 450).clip(0, 899).astype(int).T
            picture[hit], nearest[hit] = image[v, u], t[hit]
        names.append(f"frame_{i:03d}.png")
        cv2.imwrite(str(folder / names[-1]), picture.reshape(240, 320).astype(np.uint8))
    return names
