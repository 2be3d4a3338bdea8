"""The laws of keyframes, for recordings of any pace, and that sharp and moving frames are told from others."""

import itertools
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gazeloc_core.camera import Camera
from gazeloc_core.errors import Cancelled, InputError
from gazeloc_core.recording import Recording
from gazeloc_core.sfm.keyframes import FrameMeasures, KeyframeOptions, choose_keyframes, measure_frames

SECOND = 1_000_000_000


@st.composite
def recordings(draw: st.DrawFn) -> tuple[np.ndarray, FrameMeasures]:
    """Frames at 3 to 60 per second, jittered, with pauses, placeholders and bursts of motion."""
    count = draw(st.integers(1, 250))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    steps = rng.uniform(0.5, 1.5, count) * SECOND / draw(st.integers(3, 60))
    steps[rng.random(count) < draw(st.sampled_from([0.0, 0.02]))] += 3 * SECOND
    sharpness = rng.uniform(1, 1000, count)
    sharpness[rng.random(count) < draw(st.sampled_from([0.0, 0.1, 0.5]))] = 0
    sharpness[rng.integers(count)] = 5
    motion = rng.uniform(0, 60, count) * (rng.random(count) < 0.3)
    return np.cumsum(steps).astype(np.int64), FrameMeasures(sharpness, motion)


@settings(max_examples=150)
@given(recordings())
def test_the_laws_hold_at_any_pace(recording: tuple[np.ndarray, FrameMeasures]) -> None:
    times, measures = recording
    chosen = choose_keyframes(times, measures)
    usable = np.flatnonzero(measures.sharpness > 0)
    assert (np.diff(chosen) > 0).all()
    assert np.isin(chosen, usable).all()  # placeholders never
    for a, b in itertools.pairwise(chosen):  # no gap that a usable frame could have closed
        assert times[b] - times[a] <= SECOND or not ((usable > a) & (usable < b)).any()
    steps = np.diff(times[usable])
    covered_s = steps[steps <= SECOND / 2].sum() / SECOND
    assert len(chosen) >= min(len(usable), np.ceil(2 * covered_s))
    assert times[chosen[0]] - times[usable[0]] <= SECOND / 2
    assert times[usable[-1]] - times[chosen[-1]] <= SECOND / 2


def test_a_steady_video_gives_what_was_asked_for() -> None:
    times = np.arange(0, 24 * SECOND, SECOND // 30)
    still = FrameMeasures(np.full(len(times), 10.0), np.zeros(len(times)))
    assert len(choose_keyframes(times, still)) == pytest.approx(24 * 2.2, abs=2)
    options = KeyframeOptions(per_second=3, per_second_fast=6)
    assert len(choose_keyframes(times, still, options)) == pytest.approx(24 * 3, abs=2)


def test_fast_motion_gets_more_keyframes() -> None:
    times = np.arange(0, 20 * SECOND, SECOND // 30)
    motion = np.where(times < 10 * SECOND, 0.0, 40.0)
    chosen = times[choose_keyframes(times, FrameMeasures(np.full(len(times), 10.0), motion))]
    assert (chosen >= 10 * SECOND).sum() > 1.8 * (chosen < 10 * SECOND).sum()


def test_the_sharpest_of_a_slot_is_taken() -> None:
    times = np.arange(0, 10 * SECOND, SECOND // 30)
    sharpness = np.full(len(times), 10.0)
    sharp = np.arange(5, len(times), 10)  # three per second, more than there are slots
    sharpness[sharp] = 30
    chosen = choose_keyframes(times, FrameMeasures(sharpness, np.zeros(len(times))))
    assert np.isin(chosen, sharp).all()


@pytest.mark.parametrize("options", [KeyframeOptions(per_second=1.5), KeyframeOptions(per_second=9)])
def test_impossible_options_are_refused(options: KeyframeOptions) -> None:
    with pytest.raises(InputError, match="per second"):
        choose_keyframes(np.arange(10) * SECOND, FrameMeasures(np.ones(10), np.zeros(10)), options)


def test_a_recording_of_placeholders_is_refused() -> None:
    with pytest.raises(InputError, match="All 10 frames"):
        choose_keyframes(np.arange(10) * SECOND, FrameMeasures(np.zeros(10), np.zeros(10)))


class Pictures:
    """Frames held in memory."""

    def __init__(self, images: list[np.ndarray]):
        self.images = images

    def __len__(self) -> int:
        return len(self.images)

    def read(self, index: int) -> np.ndarray:
        return self.images[index]

    def iterate(self, indices):
        return ((index, self.images[index]) for index in indices)


def moving_pictures() -> Recording:
    """Texture that moves by 12 px per frame, frame 3 blurred, frame 5 the grey placeholder."""
    rng = np.random.default_rng(0)
    texture = cv2.resize(rng.integers(0, 255, (60, 80), dtype=np.uint8), (800, 600), interpolation=cv2.INTER_CUBIC)
    images = [np.repeat(texture[100:400, 12 * i : 12 * i + 400, None], 3, axis=2) for i in range(8)]
    images[3] = cv2.blur(images[3], (15, 1))
    images[5] = np.full_like(images[5], 128)
    times = np.arange(8) * SECOND // 30
    return Recording(Path("r"), "test", Camera.pinhole(400, 300, 300, 300, 200, 150), times, Pictures(images))


def test_blur_placeholders_and_motion_are_measured() -> None:
    measures = measure_frames(moving_pictures())
    assert measures.sharpness[3] < 0.8 * min(measures.sharpness[[1, 2, 4]])
    assert measures.sharpness[5] == 0
    assert measures.motion_px[0] == 0
    np.testing.assert_allclose(measures.motion_px[1:3], 12, atol=1.5)


def test_measuring_can_be_cancelled() -> None:
    def report(fraction: float, text: str = "", /) -> None:
        raise Cancelled("stop")

    with pytest.raises(Cancelled):
        measure_frames(moving_pictures(), report)
