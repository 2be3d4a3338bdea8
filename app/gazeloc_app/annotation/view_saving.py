"""Saved views on the disk: written before they show, like everything that people decide."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path

from gazeloc_app.state import AppState
from gazeloc_core.errors import GazelocError, ProjectError
from gazeloc_core.saved_views import SavedView, read_views, write_views

_log = logging.getLogger(__name__)


class ViewSaver:
    """Reads and writes the views of one project folder; the caller holds the project's lock."""

    def __init__(self, folder: Path, say: Callable[[str], None] = _log.warning):
        self._folder, self._say = folder, say
        self._written: tuple[SavedView, ...] = ()

    def read(self) -> tuple[SavedView, ...]:
        """The views that were kept; a damaged file is put aside, said, and none."""
        try:
            self._written = read_views(self._folder)
        except GazelocError as error:
            path = self._folder / "views.json"
            path.replace(path.with_name("views.damaged.json"))
            self._say(f"{error} It was put aside as views.damaged.json.")
        return self._written

    def save(self, before: AppState, after: AppState) -> None:
        """Write the views where they changed.

        Raises:
            ProjectError: if that fails; they are kept, and tried again with the next action.
        """
        del before
        if after.views == self._written:
            return
        try:
            write_views(self._folder, after.views)
        except OSError as error:
            raise ProjectError(
                f"{self._folder}: the saved views could not be written ({error.strerror}); free some space there."
            ) from error
        self._written = after.views
