"""The pictures of the panel “Frame” as the routes ask for them: the frame, and the render of the scan from its pose."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from typing import Any

from gazeloc_app.data import ProjectData
from gazeloc_app.drawing.render_process import RenderProcess
from gazeloc_app.drawing.render_worker import Frame, Render, camera_text
from gazeloc_app.state import AppState
from gazeloc_core.camera import Camera
from gazeloc_core.errors import InputError
from gazeloc_core.methods import Method
from gazeloc_core.transforms import wxyz_of

WIDTH_PX = 900
"""Wide enough for the panel: more is not seen there and takes longer to scrub."""
THUMBNAIL_PX = 144
_KEY = re.compile(rf"[0-9a-f]{{1,64}}|({'|'.join(Method)})@[0-9a-f-]{{1,64}}")


class Pictures:
    """Asks the drawing process, so that of all frames that were scrubbed over only the last is drawn.

    All browsers show the frame of the state. So a picture of that frame may push aside the others that wait, but a
    slow browser's late request for an earlier frame may not push aside that one; and browsers that ask for the same
    picture share it. Small pictures for lists, and neighbours that a page fetches while it is idle, are drawn while
    nothing else is to be drawn.
    """

    def __init__(self, data: ProjectData, process: RenderProcess, state: Callable[[], AppState]):
        self._data, self._process, self._state = data, process, state
        self._asked: dict[tuple[Frame | Render, str], Future[Any]] = {}

    async def frame(self, recording: str, index: int, query: Mapping[str, str]) -> bytes:
        """A frame as JPEG, undistorted; with `tags=1` the tags in it are drawn, with `lens=1` it is as recorded."""
        lens = query.get("lens") == "1"
        tags = query.get("tags") == "1" and not lens
        job = Frame(recording=recording, index=index, width=WIDTH_PX, with_tags=tags, as_recorded=lens)
        return await self._picture("frame", recording, index, job)

    async def thumbnail(self, recording: str, index: int, query: Mapping[str, str]) -> bytes:
        """A frame as a small JPEG for lists; every one that is asked for is made, after what people look at."""
        del query
        job = Frame(recording=recording, index=index, width=THUMBNAIL_PX, as_recorded=True)
        return bytes(await asyncio.wrap_future(self._process.submit(job, is_later=True)))

    async def render(self, recording: str, index: int, query: Mapping[str, str]) -> bytes:
        """The scan from the frame's pose of those that `rev` names (see `ProjectData.poses_key`), as JPEG.

        With `lens=1` through the lens as it is, distortion and all.
        """
        self._data.project.recording(recording)
        if not _KEY.fullmatch(query.get("rev", "")):
            raise InputError("A render is of poses, which `rev` names.")
        trajectory, camera = self._data.trajectory(recording, query.get("rev")), self._camera(recording, query)
        pose = trajectory.pose(index) if trajectory is not None and index < len(trajectory) else None
        if pose is None or camera is None:
            raise InputError(f"Frame {index} has no pose, so there is no render of it.")
        w, x, y, z = (float(value) for value in wxyz_of(pose.rotation))
        cx, cy, cz = (float(value) for value in pose.translation)
        job = Render(
            camera=camera_text(camera), wxyz=(w, x, y, z), center=(cx, cy, cz), width=min(WIDTH_PX, camera.width)
        )
        kind = f"render {query.get('rev')}"  # poses side by side do not push each other aside
        return await self._picture(kind, recording, index, job)

    def _camera(self, recording: str, query: Mapping[str, str]) -> Camera | None:
        return self._data.recording(recording).camera if query.get("lens") == "1" else self._data.camera(recording)

    async def _picture(self, kind: str, recording: str, index: int, job: Frame | Render) -> bytes:
        state = self._state()
        when = "now" if (recording, index) == (state.recording, state.frame) else "before"
        waiting = self._asked.get((job, when))
        if waiting is None or waiting.done():
            self._asked = {asked: future for asked, future in self._asked.items() if not future.done()}
            waiting = self._process.submit(job, key=f"{kind} {when}", is_later=when == "before")
            self._asked[job, when] = waiting
        return bytes(await asyncio.wrap_future(waiting))
