"""Pulls at a slider or a colour field: each is one step, though a page sends a value at every movement."""

from __future__ import annotations

import time
from collections.abc import Callable

SAME_STROKE_S = 1.5
"""A rest of so long begins a new pull."""


class Strokes:
    """Numbers pulls from 1."""

    def __init__(self, clock: Callable[[], float] = time.monotonic):
        self._clock = clock
        self._number, self._pulled_s = 0, 0.0
        self._puller: object = None

    def of(self, puller: object) -> int:
        """The number of the pull that a value belongs to; `puller` says who pulls at what."""
        now = self._clock()
        if puller != self._puller or now > self._pulled_s + SAME_STROKE_S:
            self._number += 1
        self._puller, self._pulled_s = puller, now
        return self._number
