"""The route by which our own HTML (timeline, lists) goes to a frame: viser's widgets know no clicks in HTML."""

from __future__ import annotations

import re
from collections.abc import Callable

from gazeloc_app.actions.action import Action
from gazeloc_app.actions.views import ShowFrame
from gazeloc_app.data import ProjectData
from gazeloc_app.routes import Asked, Reply, Routes
from gazeloc_app.state import AppState
from gazeloc_core.errors import InputError


def add_show_route(
    routes: Routes, data: ProjectData, state: Callable[[], AppState], dispatch: Callable[[Action], None]
) -> None:
    """`/show/<recording>/<index>`: every browser shows that frame. Changes what is shown and nothing else."""

    async def show(asked: Asked) -> Reply:
        recording, index = asked.names["recording"], asked.names["index"]
        if recording != state().recording:
            raise InputError(f"The recording {recording!r} is not the one that is shown.")
        if not re.fullmatch(r"[0-9]{1,9}", index) or int(index) >= len(data.recording(recording)):
            raise InputError(f"{index!r} is not a frame of {recording!r}.")
        dispatch(ShowFrame(int(index)))
        return Reply(body=b"", content_type="text/plain; charset=utf-8", status=204)

    routes.get("/show/{recording}/{index}", show)
