"""The pictures of the panel “Frame” as the routes ask for them: the frame, and the render of the scan from its pose."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Mapping
from concurrent.futures import Future
from typing import Any
from urllib.parse import quote

from gazeloc_app.data import ProjectData
from gazeloc_app.drawing.render_jobs import Frame, Render, camera_text
from gazeloc_app.drawing.render_process import RenderProcess
from gazeloc_core.camera import Camera
from gazeloc_core.errors import InputError
from gazeloc_core.methods import Method
from gazeloc_core.transforms import wxyz_of

WIDTH_PX = 900
"""Wide enough for the panel: more is not seen there and takes longer to scrub."""
QUICK_PX = WIDTH_PX // 4
"""Wide enough to see where a frame is; shown until the picture in full is there."""
THUMBNAIL_PX = 144
_PAGE = re.compile(r"[a-z0-9]{0,40}")
_KEY = re.compile(rf"[0-9a-f]{{1,64}}|({'|'.join(Method)})@[0-9a-f-]{{1,64}}")


def render_url(data: ProjectData, recording: str, key: str, frame: int | str) -> str:
    """Where `Pictures.render` is: another URL for other poses and other colours of the scan, as browsers keep it."""
    return f"/renders/{quote(recording)}/{frame}.jpg?rev={quote(key)}&scan={data.scan_revision}"


class Pictures:
    """Asks the drawing process, so that of all frames that a page was scrubbed over only the last is drawn.

    The query's `page` names who asks: pages do not push each other's pictures aside, and those that ask for the same
    one share it. With `quick=1` it is a quarter as wide and drawn before any in full. Small pictures for lists, and
    neighbours that a page fetches while it is idle (`ahead=1`), are drawn while nothing else is to be drawn.
    """

    def __init__(self, data: ProjectData, process: RenderProcess):
        self._data, self._process = data, process
        self._asked: dict[tuple[Frame | Render, str, str], Future[Any]] = {}
        self._turn = asyncio.Lock()

    async def frame(self, recording: str, index: int, query: Mapping[str, str]) -> bytes:
        """A frame as JPEG, undistorted; with `tags=1` the tags in it are drawn, with `lens=1` it is as recorded."""
        lens = query.get("lens") == "1"
        tags = query.get("tags") == "1" and not lens
        job = Frame(recording=recording, index=index, width=_width(query), with_tags=tags, as_recorded=lens)
        return await _bytes_of(self._submitted("frame", query, job))

    async def thumbnail(self, recording: str, index: int, query: Mapping[str, str]) -> bytes:
        """A frame as a small JPEG for lists; every one that is asked for is made, after what people look at."""
        del query
        job = Frame(recording=recording, index=index, width=THUMBNAIL_PX, as_recorded=True)
        return await _bytes_of(self._process.submit(job, is_later=True))

    async def render(self, recording: str, index: int, query: Mapping[str, str]) -> bytes:
        """The scan from the frame's pose of those that `rev` names (see `ProjectData.poses_key`), as JPEG.

        With `lens=1` through the lens as it is, distortion and all.
        """
        if not _KEY.fullmatch(query.get("rev", "")):
            raise InputError("A render is of poses, which `rev` names.")
        async with self._turn:  # in the order in which they were asked for: the last one is to be submitted last
            job = await asyncio.to_thread(self._render_job, recording, index, query)
            kind = f"render {query.get('rev')}"  # poses side by side do not push each other aside
            drawn = self._submitted(kind, query, job)
        return await _bytes_of(drawn)

    def _render_job(self, recording: str, index: int, query: Mapping[str, str]) -> Render:
        """Not for the event loop: poses under another alignment are worked out when they are first asked for."""
        trajectory, camera = self._data.trajectory(recording, query.get("rev")), self._camera(recording, query)
        pose = trajectory.pose(index) if trajectory is not None and index < len(trajectory) else None
        if pose is None or camera is None:
            raise InputError(f"Frame {index} has no pose, so there is no render of it.")
        w, x, y, z = (float(value) for value in wxyz_of(pose.rotation))
        cx, cy, cz = (float(value) for value in pose.translation)
        return Render(
            camera=camera_text(camera), wxyz=(w, x, y, z), center=(cx, cy, cz), width=min(_width(query), camera.width)
        )

    def _camera(self, recording: str, query: Mapping[str, str]) -> Camera | None:
        return self._data.recording(recording).camera if query.get("lens") == "1" else self._data.camera(recording)

    def _submitted(self, kind: str, query: Mapping[str, str], job: Frame | Render) -> Future[Any]:
        page = query.get("page", "")
        if not _PAGE.fullmatch(page):
            raise InputError("A page's id is letters and digits.")
        is_quick, is_ahead = query.get("quick") == "1", query.get("ahead") == "1"
        when = "ahead" if is_ahead else "quick" if is_quick else "now"
        same = (job, when, query.get("scan", ""))
        waiting = self._asked.get(same)
        if waiting is None or waiting.done():
            self._asked = {asked: future for asked, future in self._asked.items() if not future.done()}
            key = f"{kind} {when} {page}"
            waiting = self._process.submit(job, key=key, is_later=is_ahead, is_urgent=is_quick)
            self._asked[same] = waiting
        return waiting


async def _bytes_of(picture: Future[Any]) -> bytes:
    return bytes(await asyncio.wrap_future(picture))


def _width(query: Mapping[str, str]) -> int:
    return QUICK_PX if query.get("quick") == "1" else WIDTH_PX
