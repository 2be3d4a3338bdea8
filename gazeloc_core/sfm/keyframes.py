"""Keyframes: the frames of a recording that are to be registered, chosen before anything is known about their poses.

Time is cut into slots, short where the picture moves fast and never longer than half a second; each slot gives its
sharpest frame. Two neighbours are then at most a second apart, and there are at least two per second, wherever the
recording itself has frames.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import cv2
import numpy as np

from gazeloc_core.arrays import Bytes, Floats, Ints, frozen
from gazeloc_core.errors import InputError
from gazeloc_core.progress import Report, silent
from gazeloc_core.recording import Recording

LEAST_PER_SECOND = 2.0
LONGEST_GAP_NS = 1_000_000_000

_SHARPNESS_WIDTH = 480
_MOTION_WIDTH = 136
_UNIFORM_GREY_LEVELS = 1.5
_EDGE_OF_SLOT_WEIGHT = 0.8


@dataclass(frozen=True, kw_only=True)
class KeyframeOptions:
    """How many frames are registered."""

    per_second: float = 2.2
    """Keyframes per second where the head is still; at least 2."""
    per_second_fast: float = 5.0
    """Keyframes per second where the picture moves at the fast speed or beyond it."""
    fast_px_per_second: float = 800.0
    """The picture's speed that counts as fast, in pixels per second."""


@dataclass(frozen=True, eq=False)
class FrameMeasures:
    """Of the N frames: `sharpness` (N,), mean squared gradient, 0 for a uniform placeholder; `motion_px` (N,), the
    median movement of the picture since the frame before, 0 for the first."""

    sharpness: Floats
    motion_px: Floats

    def __post_init__(self) -> None:
        object.__setattr__(self, "sharpness", frozen(self.sharpness))
        object.__setattr__(self, "motion_px", frozen(self.motion_px))


def sharpness_of(grey: Bytes) -> float:
    """Tenengrad: the mean squared Sobel gradient of a grey picture (H, W), made small so that noise counts little.

    0 for a uniform picture, such as the grey one that stands for a camera that was unplugged.
    """
    small = _shrink(grey, _SHARPNESS_WIDTH)
    if float(small.std()) < _UNIFORM_GREY_LEVELS:
        return 0.0
    soft = cv2.GaussianBlur(small, (3, 3), 0)
    gx, gy = cv2.Sobel(soft, cv2.CV_32F, 1, 0), cv2.Sobel(soft, cv2.CV_32F, 0, 1)
    return float(np.mean(gx * gx + gy * gy))


def _shrink(grey: Bytes, width: int) -> Bytes:
    if grey.shape[1] <= width:
        return grey
    height = max(16, round(grey.shape[0] * width / grey.shape[1]))
    return np.asarray(cv2.resize(grey, (width, height), interpolation=cv2.INTER_AREA), dtype=np.uint8)


def measure_frames(recording: Recording, report: Report = silent) -> FrameMeasures:
    """Sharpness and motion of every frame, in one pass through the recording.

    Raises:
        InputError: if a frame does not decode.
        Cancelled: when `report` raises it.
    """
    count = len(recording)
    sharpness, motion = np.zeros(count), np.zeros(count)
    flow = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_ULTRAFAST)
    before: Bytes | None = None
    for index, rgb in recording.frames.iterate(range(count)):
        grey = np.asarray(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
        sharpness[index] = sharpness_of(grey)
        tiny = _shrink(grey, _MOTION_WIDTH)
        if before is not None:
            moved = np.linalg.norm(flow.calc(before, tiny, None), axis=2)
            motion[index] = float(np.median(moved)) * grey.shape[1] / tiny.shape[1]
        before = tiny
        report((index + 1) / count, f"Measured {index + 1} of {count} frames")
    return FrameMeasures(sharpness, motion)


def choose_keyframes(timestamp_ns: Ints, measures: FrameMeasures, options: KeyframeOptions | None = None) -> Ints:
    """The keyframes' indices, rising: at least 2 per second and no gap above 1 s, as far as there are usable frames.

    Raises:
        InputError: if no frame shows anything, or the options ask for fewer than 2 per second.
    """
    options = options or KeyframeOptions()
    if not LEAST_PER_SECOND <= options.per_second <= options.per_second_fast:
        raise InputError(
            f"Keyframes per second are {options.per_second} (still) and {options.per_second_fast} (fast); "
            f"the first must be at least {LEAST_PER_SECOND:g} and the second no less than the first."
        )
    usable = np.flatnonzero(measures.sharpness > 0)
    if len(usable) == 0:
        raise InputError(
            f"All {len(timestamp_ns)} frames of the recording are of one colour; was the scene camera connected?"
        )
    times = np.asarray(timestamp_ns[usable], dtype=np.int64)
    demand = _demand(times, measures.motion_px[usable], options)
    chosen = _sharpest_of_slots(demand, measures.sharpness[usable])
    return usable[_fill_gaps(times, measures.sharpness[usable], chosen)]


def _demand(times: Ints, motion_px: Floats, options: KeyframeOptions) -> Floats:
    """How many keyframes are wanted up to each usable frame, (U,), from 0."""
    seconds = np.diff(times) / 1e9
    speed = motion_px[1:] / np.maximum(seconds, 1e-3)
    fast = np.clip(speed / options.fast_px_per_second, 0, 1)
    rate = options.per_second + (options.per_second_fast - options.per_second) * fast
    return np.concatenate([[0.0], np.cumsum(rate * seconds)])


def _sharpest_of_slots(demand: Floats, sharpness: Floats) -> list[int]:
    """For each whole number of `demand` the sharpest frame, those in the middle of the slot slightly preferred."""
    slot = np.floor(demand).astype(np.int64)
    middle = 1 - 2 * np.abs(demand - slot - 0.5)
    score = sharpness * (_EDGE_OF_SLOT_WEIGHT + (1 - _EDGE_OF_SLOT_WEIGHT) * middle)
    starts = np.flatnonzero(np.diff(slot, prepend=-1))
    return [int(a + score[a:b].argmax()) for a, b in zip(starts, [*starts[1:], len(slot)], strict=True)]


def _fill_gaps(times: Ints, sharpness: Floats, chosen: list[int]) -> list[int]:
    """`chosen` and what is missing to the two laws, taken from the widest gaps that have usable frames in them."""
    chosen = sorted(chosen)
    steps = np.diff(times)
    covered_s = float(steps[steps <= LONGEST_GAP_NS / 2].sum()) / 1e9
    least = min(len(times), int(np.ceil(LEAST_PER_SECOND * covered_s)))
    while True:
        gaps = [(int(times[b] - times[a]), a, b) for a, b in itertools.pairwise(chosen) if b > a + 1]
        width, a, b = max(gaps, default=(0, 0, 0))
        if width == 0 or (width <= LONGEST_GAP_NS and len(chosen) >= least):
            return chosen
        third = (times[b] - times[a]) / 3
        inner = np.flatnonzero((times > times[a] + third) & (times < times[b] - third))
        inner = inner if len(inner) else np.arange(a + 1, b)
        chosen = sorted([*chosen, int(inner[sharpness[inner].argmax()])])
