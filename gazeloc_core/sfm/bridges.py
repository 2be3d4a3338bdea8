"""More frames where the chain of keyframes is weak.

Where the head turns fast past a bare wall, two neighbouring keyframes share little: the reconstruction breaks there, or
hangs together as by a loose hinge. The frames between them, blurred as they may be, are nearer to each other. Taken
everywhere they would cost time and let wrong frames in; taken where they are needed they joined two halves of a made-up
bare room (45 and 26 of 61 keyframes, 1.0° apart) to one model of all 61.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gazeloc_core.arrays import Ints


@dataclass(frozen=True, eq=False)
class MoreFrames:
    """Frames of the recording beside the keyframes: `frame_indices` (F,), rising, that may be taken.

    `write(frames, folder)` writes the undistorted pictures of some of them and returns their names.
    """

    frame_indices: Ints
    write: Callable[[Ints, Path], Sequence[str]]


def frames_in_gaps(keyframes: Ints, matches: Ints, candidates: Ints, least_matches: int) -> Ints:
    """The candidates (F,) between neighbours of the rising `keyframes` (K,) that have fewer `matches` (K - 1,)."""
    after = np.searchsorted(keyframes, candidates)
    inside = (after > 0) & (after < len(keyframes)) & ~np.isin(candidates, keyframes)
    weak = np.asarray(matches) < least_matches
    return np.asarray(candidates[inside][weak[after[inside] - 1]], dtype=np.int64)


def spaced(timestamp_ns: Ints, rate_hz: float) -> Ints:
    """Frames (F,), rising, about `rate_hz` of them per second of the times (N,): the first of each slot of time."""
    slot = np.floor((timestamp_ns - timestamp_ns[0]) / 1e9 * rate_hz + 0.25).astype(np.int64)
    return np.flatnonzero(np.diff(slot, prepend=-1) > 0)
