"""The colour scale: read off the right way, told apart in grey, and honest about outliers and gaps."""

import numpy as np
import pytest

from gazeloc_core.charts.color_scale import NO_VALUE, ColorScale


def lightness(colors: np.ndarray) -> np.ndarray:
    return colors @ np.array([0.2126, 0.7152, 0.0722])


def test_more_is_lighter_and_beyond_the_ends_is_the_ends_colour():
    scale = ColorScale(0.0, 0.1)
    assert (np.diff(lightness(scale.colors(np.linspace(0, 0.1, 40)))) > 0).all()
    np.testing.assert_array_equal(scale.colors([-5, 7]), scale.colors([0, 0.1]))


def test_what_is_not_known_is_grey_and_no_value_of_the_scale():
    assert ColorScale(0, 1).colors([np.nan, np.inf]).tolist() == [list(NO_VALUE)] * 2
    assert np.abs(ColorScale(0, 1).colors(np.linspace(0, 1, 500)).astype(int) - NO_VALUE).sum(axis=1).min() > 40


@pytest.mark.parametrize(("worst", "end"), [(0.018, 0.02), (0.02, 0.02), (0.021, 0.05), (0.7, 1.0), (4.0, 5.0)])
def test_errors_end_at_a_round_number_that_one_outlier_does_not_move(worst, end):
    errors = np.concatenate([np.full(99, worst), [1000.0], [np.nan]])
    assert ColorScale.of_errors(errors) == ColorScale(0.0, pytest.approx(end))


def test_no_value_makes_no_scale_and_one_value_a_narrow_one():
    assert ColorScale.of_errors([np.nan]) is None
    assert ColorScale.of_range([]) is None
    scale = ColorScale.of_range([3.0, 3.0])
    assert scale is not None
    assert scale.low < scale.high
    assert ColorScale.of_errors([0.0]).high > 0
