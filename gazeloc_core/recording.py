"""A recording of eye-tracking glasses: frames with their own timestamps, the scene camera, and gaze.

Time is int64 nanoseconds on the recording's own clock. Gaze pixels lie in the *distorted* scene image, first pixel
centre at (0.5, 0.5): readers add the half pixel where the vendor counts from (0, 0).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gazeloc_core.arrays import Bools, Floats, Ints, frozen
from gazeloc_core.camera import Camera
from gazeloc_core.errors import InputError
from gazeloc_core.frames.sources import FrameSource


@dataclass(frozen=True, eq=False)
class Gaze:
    """Gaze samples in order of time: `timestamp_ns` (M,), `pixels` (M, 2) in the distorted image, NaN where untracked.

    `worn` (M,) says whether the glasses were on, where the tracker knows.
    `fixation_id` (M,) is 0 outside of fixations; None where the export has none.
    """

    timestamp_ns: Ints
    pixels: Floats
    worn: Bools | None = None
    fixation_id: Ints | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "timestamp_ns", frozen(self.timestamp_ns, np.int64))
        object.__setattr__(self, "pixels", frozen(self.pixels))
        if self.pixels.shape != (len(self.timestamp_ns), 2):
            raise InputError(f"There are {len(self.timestamp_ns)} gaze times but {len(self.pixels)} gaze positions.")

    def __len__(self) -> int:
        return len(self.timestamp_ns)


@dataclass(frozen=True, eq=False)
class Recording:
    """One recording: `timestamp_ns` (N,) belongs to `frames` 0 to N-1, `camera` is the distorted scene camera."""

    path: Path
    format: str
    camera: Camera
    timestamp_ns: Ints
    frames: FrameSource
    gaze: Gaze | None = None
    notes: tuple[str, ...] = ()
    """What the reader found worth saying to the user, a sentence each."""

    def __post_init__(self) -> None:
        times = frozen(self.timestamp_ns, np.int64)
        object.__setattr__(self, "timestamp_ns", times)
        if len(times) == 0:
            raise InputError.of(self.path, "the recording has no frames", "export it again")
        if len(times) != len(self.frames):
            raise InputError.of(
                self.path,
                f"there are {len(times)} timestamps but {len(self.frames)} frames",
                "export the recording again",
            )
        if (np.diff(times) <= 0).any():
            at = int(np.flatnonzero(np.diff(times) <= 0)[0]) + 1
            raise InputError.of(self.path, f"the timestamps do not rise at frame {at}", "export the recording again")

    def __len__(self) -> int:
        return len(self.timestamp_ns)
