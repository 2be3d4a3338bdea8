"""How far off a camera looks, in words: with how surely, and without what the scan itself is off."""

import numpy as np
from gazeloc_app.frames.offset_text import offset_text, short_offset_text

from gazeloc_core.stages.scores import FrameScores


def scores(scan_shift_m):
    columns = (0.42, 0.6, 0.0234, 0.0068, 0.76, 0.31, scan_shift_m)
    return FrameScores(*(np.array([np.nan, value]) for value in columns))


def test_the_offset_is_told_with_its_uncertainty():
    assert offset_text(scores(0.0), 1) == "It looks 2.3 ± 0.7 cm and 0.8 ± 0.3° off."
    assert short_offset_text(scores(0.0), 1) == "2.3 ± 0.7 cm and 0.8 ± 0.3° off"


def test_an_offset_that_cannot_be_told_is_said_to_be_so():
    far_off = FrameScores(np.array([0.05]), *(np.array([np.nan]) for _ in range(6)))
    assert "too little in common" in offset_text(far_off, 0)
    assert short_offset_text(far_off, 0) == "too far off to tell how far"


def test_what_the_scan_is_off_itself_is_told_apart():
    assert "off, besides 1.5 cm by which the scan itself is off there." in offset_text(scores(0.015), 1)
