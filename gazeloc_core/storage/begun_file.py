"""What a long stage has done so far, in a file beside its artifact: a run that was cancelled or killed goes on."""

from __future__ import annotations

import io
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from gazeloc_core.errors import GazelocError
from gazeloc_core.storage.files import write_bytes_atomically

Arrays = Mapping[str, NDArray[Any]]
_Read = TypeVar("_Read")
_OF = "of"
_DAMAGES = (OSError, EOFError, BadZipFile, KeyError, IndexError, TypeError, ValueError, AttributeError, GazelocError)


class BegunFile:
    """Arrays by name, written whole or not at all; `key` names the inputs and options that they depend on."""

    def __init__(self, path: Path, key: str, every_s: float):
        self._path, self._key, self._every_s = path, key, every_s
        self._saved_at = time.monotonic()

    @property
    def is_due(self) -> bool:
        """Whether the last writing was long enough ago for another one."""
        return time.monotonic() - self._saved_at > self._every_s

    def read(self, make: Callable[[Arrays], _Read]) -> _Read | None:
        """What `make` makes of the arrays; None where there are none, or of other inputs, or damaged ones."""
        if not self._path.is_file():
            return None
        try:
            with np.load(self._path, allow_pickle=False) as file:
                return make(file) if str(file[_OF]) == self._key else None
        except _DAMAGES:
            return None

    def write(self, arrays: Arrays) -> None:
        """Put the arrays in place of what was there."""
        content = io.BytesIO()
        np.savez(content, allow_pickle=False, **{_OF: np.array(self._key)}, **arrays)
        write_bytes_atomically(self._path, content.getvalue())
        self._saved_at = time.monotonic()

    def forget(self) -> None:
        """The run has ended: remove the file."""
        self._path.unlink(missing_ok=True)
