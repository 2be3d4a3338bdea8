"""The small project's scan as if a phone had taken pictures of it: rendered from known poses, as files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from app_project import room_mesh, true_poses

from gazeloc_core.camera import Camera
from gazeloc_core.scan import ScanFrame
from gazeloc_core.surfaces.raycast import Raycaster
from gazeloc_core.surfaces.render import RayRenderer

PHONE = Camera.pinhole(480, 360, 400.0, 400.0, 240.0, 180.0)


def add_photos(app: Any, folder: Path, frames: tuple[int, ...] = (1, 7, 13)) -> None:
    """Give the app's scan pictures from where the glasses were at these frames; before a page is opened."""
    mesh = room_mesh()
    renderer = RayRenderer(mesh, raycaster=Raycaster(mesh))
    photos = []
    for number, pose in enumerate(true_poses()[np.array(frames)]):
        path = folder / f"photo_{number}.png"
        cv2.imwrite(str(path), cv2.cvtColor(renderer.render(PHONE, pose).rgb, cv2.COLOR_RGB2BGR))
        photos.append(ScanFrame(path.stem, number, PHONE, pose, path))
    scan = replace(app.data.scan(), frames=tuple(photos))
    app.data.scan = lambda: scan
