"""Gaze that cannot belong to its frames is refused or said to be, not cast into the scan in silence."""

import numpy as np
import pytest

from gazeloc_core.camera import Camera
from gazeloc_core.errors import InputError
from gazeloc_core.readers.gaze_check import check_gaze
from gazeloc_core.recording import Gaze, Recording

CAMERA = Camera.pinhole(640, 480, 500, 500, 320, 240)
TIMES = 10**18 + np.arange(10) * 100_000_000


class NoFrames:
    """Frames that nobody reads."""

    def __len__(self):
        return len(TIMES)


def recording(tmp_path, pixels, shift_s=0.0):
    pixels = np.array(pixels, dtype=np.float64)
    times = TIMES[0] + np.arange(len(pixels)) * 5_000_000 + round(shift_s * 1e9)
    return Recording(tmp_path, "test", CAMERA, TIMES, NoFrames(), Gaze(times, pixels))


def test_gaze_in_the_picture_needs_no_word(tmp_path):
    spread = np.random.default_rng(0).uniform((0, 0), (640, 480), (100, 2))
    spread[::7] = np.nan  # blinks
    assert check_gaze(recording(tmp_path, spread)) == []


def test_shares_of_the_picture_are_refused(tmp_path):
    shares = np.random.default_rng(0).uniform(0, 1, (100, 2)) + 0.5  # half a pixel is added by readers
    with pytest.raises(InputError, match=r"in shares of the picture .*multiply x by the width"):
        check_gaze(recording(tmp_path, shares))


@pytest.mark.parametrize(("shift_s", "said"), [(-3600.0, "3,599.5 s apart"), (60.9, "60.0 s apart")])
def test_another_clock_is_said(tmp_path, shift_s, said):
    (note,) = check_gaze(recording(tmp_path, np.full((100, 2), 200.0), shift_s))
    assert said in note
    assert "different clocks" in note


def test_gaze_of_another_picture_is_said(tmp_path):
    (note,) = check_gaze(recording(tmp_path, [(900, 100)] * 60 + [(100, 100)] * 40))
    assert note == "60% of the gaze samples lie outside of the picture, which is 640x480."
