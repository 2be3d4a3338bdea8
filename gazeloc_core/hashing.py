"""Content hashes of files, folders and values: how a stage knows whether its inputs are still the same."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

from gazeloc_core.errors import InputError

_CHUNK = 1 << 20
DIGITS = 16


def hash_of_value(value: Any) -> str:
    """The hash of a JSON value, the same for any order of keys."""
    text = json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.blake2b(text.encode(), digest_size=DIGITS // 2).hexdigest()


class FileHasher:
    """Hashes of files by content, remembered in a JSON file by path, size and time of change."""

    def __init__(self, memory: Path):
        self._memory = memory
        self._known: dict[str, str] = {}
        try:
            self._known = dict(json.loads(memory.read_text()))
        except (OSError, ValueError):
            self._known = {}  # a memory that cannot be read costs time, nothing else

    def hash_of(self, path: Path) -> str:
        """The hash of a file's content, or of a folder's file names and contents (hidden files left out).

        Raises:
            InputError: if the path is missing.
        """
        if path.is_file():
            return self._hash_of_file(path)
        if not path.is_dir():
            raise InputError.of(path, "the file or folder is missing", "restore it or choose another")
        files = sorted(
            p for p in path.rglob("*") if p.is_file() and not any(x.startswith(".") for x in p.relative_to(path).parts)
        )
        return hash_of_value([[p.relative_to(path).as_posix(), self._hash_of_file(p)] for p in files])

    def remember(self) -> None:
        """Write the memory, if the place can be written to."""
        try:
            self._memory.parent.mkdir(parents=True, exist_ok=True)
            part = self._memory.with_suffix(".part")
            part.write_text(json.dumps(self._known))
            part.replace(self._memory)
        except OSError:
            return  # hashes are only remembered to save time

    def _hash_of_file(self, path: Path) -> str:
        stat = path.stat()
        key = f"{path.resolve()}|{stat.st_size}|{stat.st_mtime_ns}"
        if key not in self._known:
            digest = hashlib.blake2b(digest_size=DIGITS // 2)
            with path.open("rb") as file:
                while chunk := file.read(_CHUNK):
                    digest.update(chunk)
            self._known[key] = digest.hexdigest()
        return self._known[key]
