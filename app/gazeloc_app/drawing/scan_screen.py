"""The scan as the scene draws it: a small one at once, a large one from the project, where the drawing process puts it.

Clustering a million faces and packing them takes seconds and much of Python's GIL, so that it happens once per scan
and in another process (render_jobs.MakeDisplay); meanwhile the scene shows `glimpse`, some points of the surface.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from gazeloc_app.actions.action import Action, Notify
from gazeloc_app.actions.views import ScanPrepared
from gazeloc_app.data import ProjectData
from gazeloc_app.drawing.render_jobs import MakeDisplay
from gazeloc_app.drawing.render_process import RenderProcess
from gazeloc_app.state import Level
from gazeloc_core.errors import GazelocError
from gazeloc_core.scan import Mesh
from gazeloc_core.stages.display import load_display, scanned_from
from gazeloc_core.surfaces.scan_display import ScanDisplay, scan_display

SMALL = 100_000
"""Faces of a mesh that is packed in a tenth of a second, so that keeping it would win nothing."""
_log = logging.getLogger(__name__)


class ScanScreen:
    """What the scene draws of the scan. `display()` belongs to the store's loop; `dispatch` tells it to look again."""

    def __init__(self, data: ProjectData, render: RenderProcess, dispatch: Callable[[Action], None]):
        self._data, self._render, self._dispatch = data, render, dispatch
        self._of: Mesh | None = None
        self._display: ScanDisplay | None = None

    def display(self) -> ScanDisplay | None:
        """The display of the scan as it is now, None while it is being made."""
        mesh = self._data.mesh()
        if mesh is self._of:
            return self._display
        self._of = mesh
        if len(mesh.faces) <= SMALL:
            self._display = scan_display(mesh, scanned_from(self._data.scan(), mesh))
        else:
            self._display = load_display(self._data.project)
            if self._display is None:
                self._dispatch(Notify(Level.INFO, "The scan is being made fit for the screen; its points show until."))
                self._render.submit(MakeDisplay()).add_done_callback(lambda future: self._made(mesh, future))
        return self._display

    def _made(self, mesh: Mesh, future: Future[Any]) -> None:
        error = future.exception()
        if mesh is not self._of:  # the scan got colours meanwhile, which have a display of their own
            return
        if error is None:
            self._display = load_display(self._data.project)
            self._dispatch(ScanPrepared())
        elif isinstance(error, GazelocError):
            self._dispatch(Notify(Level.ERROR, f"The scan shows as points only: {error}"))
        else:
            _log.error("making the scan's display", exc_info=error)
