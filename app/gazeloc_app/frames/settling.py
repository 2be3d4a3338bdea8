"""Doing what is slow once quick changes have come to rest: the 3D view follows the frame, and does not hold it up."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

REST_S = 0.25
MOST_S = 1.0


class Settling:
    """Calls the last function it was given once no other came for `rest_s`; where they keep coming, every `most_s`."""

    def __init__(self, rest_s: float = REST_S, most_s: float = MOST_S):
        self._rest_s, self._most_s = rest_s, most_s
        self._lock = threading.Lock()
        self._waiting: Callable[[], object] | None = None
        self._first_s = 0.0
        self._timer: threading.Timer | None = None

    def soon(self, do: Callable[[], object]) -> None:
        """Call `do` on another thread once things are at rest, unless another one is given before."""
        with self._lock:
            now = time.monotonic()
            if self._waiting is None:
                self._first_s = now
            self._waiting = do
            self._restart(min(self._rest_s, self._first_s + self._most_s - now))

    def now(self, do: Callable[[], object]) -> None:
        """Call `do` at once, in place of what waits."""
        self.drop()
        do()

    def drop(self) -> None:
        """Forget what waits."""
        with self._lock:
            self._waiting = None
            if self._timer is not None:
                self._timer.cancel()

    def _restart(self, wait_s: float) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._timer = threading.Timer(max(wait_s, 0.0), self._do)
        self._timer.daemon = True
        self._timer.start()

    def _do(self) -> None:
        with self._lock:
            do, self._waiting = self._waiting, None
        if do is not None:
            do()
