"""Content hashes of files, folders and values: how a stage knows whether its inputs are still the same."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from gazeloc_core.errors import InputError
from gazeloc_core.storage.files import replacement_of

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
        self._has_news = False
        try:
            self._known = dict(json.loads(memory.read_text()))
        except (OSError, ValueError, TypeError):
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
        files = sorted(_files_below(path, os.path.realpath(path)), key=lambda file: file.parts)
        return hash_of_value([["/".join(file.parts), self._hash_of(file.real, file.size, file.time)] for file in files])

    def remember(self) -> None:
        """Write the memory where it has grown, if the place can be written to."""
        if not self._has_news:
            return
        try:
            self._memory.parent.mkdir(parents=True, exist_ok=True)
            with replacement_of(self._memory) as part:
                part.write_text(json.dumps(self._known))
                part.replace(self._memory)
        except OSError:
            return  # hashes are only remembered to save time

    def _hash_of_file(self, path: Path) -> str:
        stat = path.stat()
        return self._hash_of(str(path.resolve()), stat.st_size, stat.st_mtime_ns)

    def _hash_of(self, real: str, size: int, time: int) -> str:
        key = f"{real}|{size}|{time}"
        if key not in self._known:
            digest = hashlib.blake2b(digest_size=DIGITS // 2)
            with open(real, "rb") as file:
                while chunk := file.read(_CHUNK):
                    digest.update(chunk)
            self._known[key] = digest.hexdigest()
            self._has_news = True
        return self._known[key]


class _File(NamedTuple):
    """A file below a folder: its name there in parts, where it really is, its size and time of change in ns."""

    parts: tuple[str, ...]
    real: str
    size: int
    time: int


def _files_below(folder: Path | str, real: str, parts: tuple[str, ...] = ()) -> Iterator[_File]:
    """All files but hidden ones. Recordings may be folders of ten thousand pictures, so no `Path` for each."""
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.name.startswith("."):
                continue
            is_link, place = entry.is_symlink(), os.path.join(real, entry.name)
            if entry.is_file():
                stat = entry.stat()
                where = os.path.realpath(entry.path) if is_link else place
                yield _File((*parts, entry.name), where, stat.st_size, stat.st_mtime_ns)
            elif entry.is_dir() and not is_link:
                yield from _files_below(entry.path, place, (*parts, entry.name))
