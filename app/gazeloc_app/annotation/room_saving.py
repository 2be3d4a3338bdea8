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

from gazeloc_app.annotation.layers_json import read_layers, write_layers
from gazeloc_app.state import Annotation, AppState, Layer
from gazeloc_core.errors import GazelocError, ProjectError
from gazeloc_core.surfaces.layer_colors import read_layer_colors, write_layer_colors
from gazeloc_core.surfaces.saved_views import read_views, write_views

_log = logging.getLogger(__name__)


class RoomSaver:
    """Reads and writes these files of one project folder; the caller holds the project's lock."""

    def __init__(self, folder: Path, say: Callable[[str], None] = _log.warning):
        self._folder, self._say = folder, say
        self._written = Annotation()

    def read(self) -> Annotation:
        """What was kept, in an annotation that is empty otherwise; a damaged file is put aside, said, and empty."""
        found = Annotation()
        try:
            found = replace(found, views=read_views(self._folder))
        except GazelocError as error:
            self._put_aside("views.json", error)
        try:
            colors = read_layer_colors(self._folder)
            known = {layer.value: layer for layer in Layer}
            found = replace(found, tints=tuple((known[name], colors[name]) for name in colors if name in known))
        except GazelocError as error:
            self._put_aside("colors.json", error)
        try:
            found = replace(found, layers=read_layers(self._folder))
        except GazelocError as error:
            self._put_aside("layers.json", error)
        self._written = found
        return found

    def save(self, before: AppState, after: AppState) -> None:
        """Write what changed.

        Raises:
            ProjectError: if that fails; it is kept, and tried again with the next action.
        """
        del before
        now = after.annotation
        try:
            if now.views != self._written.views:
                write_views(self._folder, now.views)
                self._written = replace(self._written, views=now.views)
            if now.tints != self._written.tints:
                write_layer_colors(self._folder, {layer.value: tint for layer, tint in now.tints})
                self._written = replace(self._written, tints=now.tints)
            if now.layers != self._written.layers:
                write_layers(self._folder, now.layers)
                self._written = replace(self._written, layers=now.layers)
        except OSError as error:
            raise ProjectError(
                f"{self._folder}: saved views and what shows in the scene could not be written ({error.strerror}); "
                "free some space there."
            ) from error

    def _put_aside(self, name: str, error: GazelocError) -> None:
        path = self._folder / name
        aside = path.with_suffix(".damaged.json")
        path.replace(aside)
        self._say(f"{error} It was put aside as {aside.name}.")
