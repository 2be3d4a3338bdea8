"""What people decided about the room, saved views, layers and their colours: one file each, for all recordings.

The recording's journal has them too, so that they can be undone, and is written first. Another recording's history is
brought up to these files when it is opened (`History.with_room_of`). A kill between the two leaves the journal without
its mark: then it knows the newest (`Saver.room_after_a_kill`), and the files follow with the next action.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from gazeloc_app.annotation.layers_json import read_layers, write_layers
from gazeloc_app.state import ABOUT_THE_ROOM, Annotation, AppState, Layer
from gazeloc_core.errors import GazelocError, ProjectError
from gazeloc_core.project import Project
from gazeloc_core.storage.files import put_aside
from gazeloc_core.surfaces.glb import Rgb
from gazeloc_core.surfaces.layer_colors import read_layer_colors, write_layer_colors
from gazeloc_core.surfaces.saved_views import read_views, write_views

_log = logging.getLogger(__name__)


def _read_tints(folder: Path) -> tuple[tuple[Layer, Rgb], ...]:
    colors = read_layer_colors(folder)
    known = {layer.value: layer for layer in Layer}
    return tuple((known[name], colors[name]) for name in colors if name in known)


_FILES: dict[str, tuple[str, Callable[[Path], Any]]] = {
    "views": ("views.json", read_views),
    "tints": ("colors.json", _read_tints),
    "layers": ("layers.json", read_layers),
}
"""Of each field of `Annotation` that is about the room: its file, and how that is read."""


class RoomSaver:
    """Reads and writes these files of one project folder; the caller holds the project's lock."""

    def __init__(self, folder: Path, say: Callable[[str], None] = _log.warning):
        self._folder, self._say = folder, say
        self._written = Annotation()

    def read(self, otherwise: Annotation | None = None) -> Annotation:
        """What was kept, in an annotation that is empty otherwise.

        A damaged file is put aside and said; then what `otherwise` has counts, and is written with the next action.
        """
        otherwise = otherwise or Annotation()
        found = self._written = Annotation()
        for name, (file, read) in _FILES.items():
            try:
                value = read(self._folder)
                self._written = replace(self._written, **{name: value})
            except GazelocError as error:
                self._put_aside(file, error)
                value = getattr(otherwise, name)
            found = replace(found, **{name: value})
        return found

    def save(self, before: AppState, after: AppState) -> None:
        """Write what changed.

        Raises:
            ProjectError: if that fails; it is kept, and tried again with the next action.
        """
        del before
        Project(self._folder).check_is_there()
        now = after.annotation
        try:
            if now.views != self._written.views:
                write_views(self._folder, now.views)
            if now.tints != self._written.tints:
                write_layer_colors(self._folder, {layer.value: tint for layer, tint in now.tints})
            if now.layers != self._written.layers:
                write_layers(self._folder, now.layers)
            self._written = replace(Annotation(), **{name: getattr(now, name) for name in ABOUT_THE_ROOM})
        except OSError as error:
            raise ProjectError(
                f"{self._folder}: saved views and what shows in the scene could not be written ({error.strerror}); "
                "free some space there."
            ) from error

    def _put_aside(self, name: str, error: GazelocError) -> None:
        aside = put_aside(self._folder / name)
        self._say(f"{error} It was put aside as {aside.name}; what the history knows is used.")
