"""The loupe: the scan around a place, enlarged, drawn by the drawing process and reached by a URL of our own.

`/loupe.jpg?at=x,y,z&from=x,y,z`: numbers of the page, so checked like all of them.
"""

from __future__ import annotations

import asyncio
import math
import re
from urllib.parse import quote

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from gazeloc_app.data import ProjectData
from gazeloc_app.drawing.facing import place_to_stand
from gazeloc_app.drawing.render_jobs import Frame, Render, camera_text
from gazeloc_app.drawing.render_process import RenderProcess
from gazeloc_app.routes import Asked, Reply, Routes
from gazeloc_app.state import AppState
from gazeloc_core.arrays import Floats
from gazeloc_core.camera import Camera
from gazeloc_core.errors import InputError
from gazeloc_core.keypoints import Point
from gazeloc_core.surfaces.viewpoint import up_vector
from gazeloc_core.transforms import wxyz_of

SIZE_PX = 320
ACROSS_M = 0.25
"""What the loupe shows from edge to edge: a centimetre is 13 pixels."""
FRAME_PX = 900
"""Width of a frame of which a part is shown; several frames are shown at once, so none pushes another aside."""
FARTHEST = 1e4
_KEPT_S = 300


def loupe_url(at: str, start: str, revision: int) -> str:
    """The URL of the scan around a place, seen from another (see `loupe_places`)."""
    return f"/loupe.jpg?at={quote(at)}&from={quote(start)}&rev={revision}"


def loupe_places(data: ProjectData, state: AppState, in_scan: Point) -> tuple[str, str]:
    """The place and the eye from which the loupe sees it, as `place_from_text` reads them."""
    eye = place_to_stand(data, state, in_scan)
    at, start = (",".join(f"{float(value):.4f}" for value in point) for point in (in_scan, eye))
    return at, start


def add_loupe_route(routes: Routes, data: ProjectData, process: RenderProcess) -> None:
    """Answer `loupe_url`, of several that wait only the newest; and `/loupe/<recording>/<index>.jpg`, every one."""

    async def answer(asked: Asked) -> Reply:
        place, eye = (place_from_text(asked.query.get(name, "")) for name in ("at", "from"))
        job = _job(place, eye, up_vector(data.scan().up_axis))
        body = bytes(await asyncio.wrap_future(process.submit(job, key="loupe")))
        return Reply(body=body, content_type="image/jpeg", cache_s=_KEPT_S)

    async def answer_frame(asked: Asked) -> Reply:
        index = asked.names["index"]
        if not re.fullmatch(r"[0-9]{1,9}", index):
            raise InputError(f"{index[:20]!r} is not a frame's number.")
        job = Frame(recording=asked.names["recording"], index=int(index), width=FRAME_PX)
        body = bytes(await asyncio.wrap_future(process.submit(job, key=f"loupe {job}")))
        return Reply(body=body, content_type="image/jpeg", cache_s=_KEPT_S)

    routes.get("/loupe.jpg", answer)
    routes.get("/loupe/{recording}/{index}.jpg", answer_frame)


def loupe_view(place: Floats, eye: Floats, up: Floats) -> tuple[Camera, RigidTransform]:
    """The camera of the loupe and where it stands, `scan_from_camera`.

    Raises:
        InputError: if it stands on the place that it shows.
    """
    away = float(np.linalg.norm(place - eye))
    if away < 0.01:
        raise InputError("The loupe stands on the place that it shows.")
    focal_px = SIZE_PX * away / ACROSS_M
    camera = Camera.pinhole(SIZE_PX, SIZE_PX, focal_px, focal_px, SIZE_PX / 2, SIZE_PX / 2)
    return camera, pose_facing(eye, place, up)


def _job(place: Floats, eye: Floats, up: Floats) -> Render:
    camera, pose = loupe_view(place, eye, up)
    w, x, y, z = (float(value) for value in wxyz_of(pose.rotation))
    cx, cy, cz = (float(value) for value in eye)
    return Render(camera=camera_text(camera), wxyz=(w, x, y, z), center=(cx, cy, cz))


def pose_facing(eye: Floats, place: Floats, up: Floats) -> RigidTransform:
    """`scan_from_camera` at the eye, the place in its middle, upright where that can be."""
    forward = (place - eye) / np.linalg.norm(place - eye)
    right = np.cross(forward, up)
    if np.linalg.norm(right) < 1e-6:
        right = np.cross(forward, np.eye(3)[int(np.abs(forward).argmin())])
    right = right / np.linalg.norm(right)
    axes = np.stack([right, np.cross(forward, right), forward], axis=1)
    return RigidTransform.from_components(eye, Rotation.from_matrix(axes))


def place_from_text(text: str) -> Floats:
    """The place (3,) that a page names by “x,y,z”.

    Raises:
        InputError: if it is none.
    """
    parts = text.split(",") if len(text) <= 120 else []
    try:
        values = [float(part) for part in parts]
    except ValueError:
        values = []
    if len(values) != 3 or not all(math.isfinite(value) and abs(value) <= FARTHEST for value in values):
        raise InputError(f"{text[:40]!r} is no place; the loupe needs three numbers.")
    return np.array(values)
