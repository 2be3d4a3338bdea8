"""Stretches of a recording between two images of a reconstruction, and before its first and after its last one."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gazeloc_core.arrays import Bools, Ints


@dataclass(frozen=True)
class Stretch:
    """Frames without an image, between the frames `before` and `after` that have one (None: there is none).

    `from_before` are the frames within reach of `before`, rising; `from_after` those within reach of `after`, falling.
    In a short stretch both are all of its frames.
    """

    before: int | None
    after: int | None
    from_before: range
    from_after: range

    @property
    def frames(self) -> list[int]:
        """The frames within reach of either end, rising."""
        return sorted({*self.from_before, *self.from_after})

    @property
    def needed(self) -> list[int]:
        """The frames whose pictures it takes: `frames` and the ends from which something is within reach, rising."""
        ends = [
            end for end, reached in ((self.before, self.from_before), (self.after, self.from_after)) if len(reached)
        ]
        return sorted({*self.frames, *(end for end in ends if end is not None)})


def stretches(image_frames: Ints, is_taken: Bools, timestamp_ns: Ints, reach_s: float, most: int) -> Iterator[Stretch]:
    """The stretches around the rising `image_frames` (K,) of a recording with times (N,), in order.

    A frame is within reach of an image that is at most `reach_s` and `most` frames away; nothing that `is_taken` (N,),
    having an image of its own, is in a stretch or is passed over.
    """
    times = np.asarray(timestamp_ns, dtype=np.int64)
    reach_ns = round(reach_s * 1e9)
    stops = [None, *image_frames.tolist(), None]
    for before, after in itertools.pairwise(stops):
        first, last = (-1 if before is None else before), (len(times) if after is None else after)
        forward, backward = range(0), range(0)
        if before is not None:
            end = int(np.searchsorted(times, times[before] + reach_ns, side="right"))
            end = _stop_at(is_taken, range(before + 1, min(end, last, before + 1 + most)))
            forward = range(before + 1, end)
        if after is not None:
            end = int(np.searchsorted(times, times[after] - reach_ns, side="left"))
            end = _stop_at(is_taken, range(after - 1, max(end - 1, first, after - 1 - most), -1))
            backward = range(after - 1, end, -1)
        if len(forward) or len(backward):
            yield Stretch(before, after, forward, backward)


def _stop_at(is_taken: Bools, frames: range) -> int:
    """Where a walk along `frames` ends: at the first that is taken, else behind the last."""
    return next((frame for frame in frames if is_taken[frame]), frames.stop)
