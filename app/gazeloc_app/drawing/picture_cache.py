"""Pictures that were drawn, by the job that asked for them."""

from __future__ import annotations

import threading
from collections import OrderedDict
from typing import Any

from gazeloc_app.drawing.render_jobs import Cast, Job


class PictureCache:
    """The last pictures, up to a number of bytes; safe to use from several threads."""

    def __init__(self, max_bytes: int):
        self._max_bytes = max_bytes
        self._size = 0
        self.revision = 0
        """Counts up when all pictures are outdated."""
        self._pictures: OrderedDict[Job, bytes] = OrderedDict()
        self._lock = threading.Lock()

    def get(self, job: Job) -> bytes | None:
        """The picture of a job, None where it is not kept."""
        if isinstance(job, Cast):
            return None
        with self._lock:
            if job in self._pictures:
                self._pictures.move_to_end(job)
            return self._pictures.get(job)

    def put(self, job: Job, answer: Any, revision: int) -> None:
        """Keep a picture that was begun at a revision, unless it is outdated by now."""
        if not isinstance(answer, bytes):
            return
        with self._lock:
            if revision != self.revision:
                return
            self._size += len(answer) - len(self._pictures.pop(job, b""))
            self._pictures[job] = answer
            while self._size > self._max_bytes:
                self._size -= len(self._pictures.popitem(last=False)[1])

    def clear(self) -> None:
        """Forget all pictures: they are outdated, and so is what is being drawn now."""
        with self._lock:
            self._pictures.clear()
            self._size = 0
            self.revision += 1
