"""Where GazeLoc keeps on this computer what it can make again: the demo's project, scenes, grids of tag quality."""

from __future__ import annotations

import os
from pathlib import Path

from gazeloc_core.errors import GazelocError


def user_cache() -> Path:
    """The folder `gazeloc` in the user's cache, made if it is missing.

    Raises:
        GazelocError: if it cannot be made.
    """
    folder = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "gazeloc"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise GazelocError(
            f"{folder}: this folder cannot be made ({error.strerror}); set XDG_CACHE_HOME to one that can."
        ) from error
    return folder
