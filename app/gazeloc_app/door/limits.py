"""How much anybody may ask for at once, so that one client cannot take the app away from the others."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable

MAX_MESSAGE_BYTES = 4 * 1024 * 1024
"""Largest message that a browser may send; the biggest honest one is a part of an upload, half a megabyte."""
MAX_PAGES = 32
"""Pages that are connected at a time."""
MAX_CONNECTIONS = 256
"""Connections of any kind at a time; a page fetches a picture over each of six."""
MAX_WAITING = 64
"""Connections that have not said yet what they want; the eldest has to go when one more comes."""
REQUEST_TIMEOUT_S = 10.0
"""Time to say it. A browser does at once."""
MESSAGES_PER_S = 250.0
"""A page's messages beyond this are read later, not lost; a moved camera and a dragged slider send some 60 each."""
BURST = 500
MAX_REFUSED = 50
"""Messages of a page that are refused before its connection is closed."""


class Pace:
    """Lets `BURST` messages through at once, then `MESSAGES_PER_S`."""

    def __init__(self, clock: Callable[[], float] = time.monotonic):
        self._clock = clock
        self._left, self._at = float(BURST), clock()

    def delay_s(self) -> float:
        """How long the message that has just come must wait."""
        now = self._clock()
        self._left = min(float(BURST), self._left + (now - self._at) * MESSAGES_PER_S) - 1
        self._at = now
        return max(0.0, -self._left / MESSAGES_PER_S)

    async def wait(self) -> None:
        """Hold one page's reader back; what it sends meanwhile fills its own socket and nobody else's."""
        delay = self.delay_s()
        if delay > 0:
            await asyncio.sleep(delay)
