"""An append-only file of JSON lines that survives kill -9: what was appended and flushed is read again, whole.

A crash in the middle of a line leaves a tail without a line end: it was never acknowledged, and is cut off before the
next line is written. One process writes (lock.py).
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from gazeloc_core.errors import InputError
from gazeloc_core.storage.files import flush_folder, write_text_atomically


class Journal:
    """The lines of one file."""

    def __init__(self, path: Path):
        self.path = path
        self._end = 0
        """Bytes of whole lines."""
        self._left: tuple[int, int] | None = None
        """Which file it was (its inode) and how long, None where there was none."""
        self.read()

    @property
    def is_as_left(self) -> bool:
        """Whether the file is the one that was read or written last: others may have replaced or cut it."""
        try:
            return self._left == _inode_and_size(self.path.stat())
        except OSError:
            return self._left is None

    def read(self) -> list[Any]:
        """The values of all whole lines, in order; none where there is no file.

        Raises:
            InputError: if a line is not JSON, or the file cannot be read.
        """
        try:
            data = self.path.read_bytes()
        except FileNotFoundError:
            return []
        except OSError as error:
            raise InputError.of(self.path, f"the file cannot be read ({error.strerror})", "mend that") from error
        self._end = data.rfind(b"\n") + 1
        self._left = _inode_and_size(self.path.stat())
        lines = data[: self._end].splitlines()
        try:
            return [json.loads(line.decode("utf-8")) for line in lines]
        except (ValueError, RecursionError) as error:
            raise InputError.of(self.path, f"a line is not valid JSON ({error})", "restore the file") from error

    def append(self, values: Iterable[Any], *, flush: bool = True) -> None:
        """Add one line for each value; on return they are on the disk, without `flush` only safe from a kill.

        Raises:
            OSError: if they cannot be written; the file is then as it was before, or becomes so with the next append.
        """
        data = b"".join(_line(value) for value in values)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        is_new = self._end == 0
        file = os.open(self.path, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            os.ftruncate(file, self._end)
            os.lseek(file, self._end, os.SEEK_SET)
            _write_whole(file, data)
            if flush:
                os.fsync(file)
        finally:
            self._left = _inode_and_size(os.fstat(file))
            os.close(file)
        if flush and is_new:
            flush_folder(self.path.parent)
        self._end += len(data)

    def rewrite(self, values: Iterable[Any]) -> None:
        """Replace all lines in one step."""
        data = b"".join(_line(value) for value in values)
        write_text_atomically(self.path, data.decode("utf-8"))
        self._end, self._left = len(data), _inode_and_size(self.path.stat())


def _inode_and_size(status: os.stat_result) -> tuple[int, int]:
    return status.st_ino, status.st_size


def _line(value: Any) -> bytes:
    return json.dumps(value, allow_nan=False, separators=(",", ":")).encode("utf-8") + b"\n"


def _write_whole(file: int, data: bytes) -> None:
    rest = memoryview(data)
    while rest:
        rest = rest[os.write(file, rest) :]
