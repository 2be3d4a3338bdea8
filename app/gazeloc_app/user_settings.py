"""What one user wants in every project: ~/.config/gazeloc/settings.json (or under XDG_CONFIG_HOME)."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from gazeloc_app.state import AppState
from gazeloc_core.errors import GazelocError
from gazeloc_core.storage.files import write_json_atomically
from gazeloc_core.storage.user_files import read_json_object

_SAFE_COLORS = "safe_colors"
_log = logging.getLogger(__name__)


def settings_path() -> Path:
    """Where the settings are, whether or not there are any."""
    return Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config") / "gazeloc" / "settings.json"


class UserSettings:
    """Puts the user's settings into the state at the start, and writes them when they change."""

    def __init__(self, say: Callable[[str], None] = _log.warning):
        """`say` is told of a file that cannot be read; everything is as usual then."""
        self._say = say
        self._written = False

    def put_into(self, state: AppState) -> AppState:
        """The state with the user's settings."""
        self._written = self._read()
        return replace(state, are_colors_safe=self._written)

    def save(self, before: AppState, after: AppState) -> None:
        """Write them where they changed.

        Raises:
            GazelocError: if that fails.
        """
        del before
        is_on = after.are_colors_safe
        if is_on == self._written:
            return
        path = settings_path()
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            write_json_atomically(path, {_SAFE_COLORS: is_on})
            self._written = is_on
        except OSError as error:
            raise GazelocError(
                f"{path}: your choice of colours could not be kept ({error.strerror}); it is tried again."
            ) from error

    def _read(self) -> bool:
        path = settings_path()
        if not path.exists():
            return False
        try:
            return read_json_object(path).get(_SAFE_COLORS) is True
        except GazelocError as error:
            self._say(f"{error} The usual colours are shown.")
            return False
