"""One process writes to a project at a time; a second one is told who does.

The lock is the operating system's (it goes when the process goes, however it ends); the file's text only names the
holder. A worker process that the holder started may write on the holder's behalf, so it does not lock again.
"""

from __future__ import annotations

import json
import os
import socket
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from types import TracebackType
from typing import IO

from gazeloc_core.errors import ProjectLockedError

if sys.platform == "win32":
    import msvcrt

    def _lock(file: IO[str]) -> None:
        file.seek(1 << 20)  # past the text, which others must be able to read
        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)

    def _lock_when_free(file: IO[str]) -> None:
        msvcrt.locking(file.fileno(), msvcrt.LK_LOCK, 1)
else:
    import fcntl

    def _lock(file: IO[str]) -> None:
        fcntl.flock(file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)

    def _lock_when_free(file: IO[str]) -> None:
        fcntl.flock(file.fileno(), fcntl.LOCK_EX)


PATIENCE_S = 0.5
"""For how long a project is asked for again before it counts as somebody else's."""


@contextmanager
def brief_lock(path: Path) -> Iterator[None]:
    """Keep others out while a file is read, changed and written: the app and its worker process both write settings."""
    with path.open("a+", encoding="utf-8") as file:
        _lock_when_free(file)
        yield


class WriteLock:
    """Held from construction to `release()`; also a context manager."""

    def __init__(self, path: Path):
        """Take the lock.

        Raises:
            ProjectLockedError: if another process holds it.
        """
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file: IO[str] | None = path.open("a+", encoding="utf-8")
        try:
            _lock_soon(self._file)
        except OSError as error:
            holder = _holder(self._file)
            self._file.close()
            self._file = None
            raise ProjectLockedError(
                f"{path.parent}: another process is writing to this project ({holder}); close it or wait for it to end."
            ) from error
        self._file.seek(0)
        self._file.truncate()
        since = datetime.now().astimezone().isoformat(timespec="minutes")
        own = {"pid": os.getpid(), "host": socket.gethostname(), "since": since, "command": sys.argv[:3]}
        self._file.write(json.dumps(own))
        self._file.flush()

    def release(self) -> None:
        """Let others write. Does nothing the second time."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def __enter__(self) -> WriteLock:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()


def _lock_soon(file: IO[str]) -> None:
    """Lock, or raise OSError: a process that is being started right now holds its parent's open files for a moment."""
    end = time.monotonic() + PATIENCE_S
    while True:
        try:
            _lock(file)
            return
        except OSError:
            if time.monotonic() > end:
                raise
            time.sleep(0.02)


def _holder(file: IO[str]) -> str:
    file.seek(0)
    try:
        value = json.loads(file.read())
        since = datetime.fromisoformat(value["since"]).strftime("%Y-%m-%d %H:%M")
        return f"process {value['pid']} on {value['host']} since {since}: {' '.join(value['command'])}"
    except (ValueError, KeyError, TypeError):
        return "it left no name"
