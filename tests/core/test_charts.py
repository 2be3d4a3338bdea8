"""Charts survive JSON, are drawn as files, and refuse columns that do not belong together."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gazeloc_core.charts.values import Chart, HeatMap, Series, chart_from_json
from gazeloc_core.errors import GeometryError
from gazeloc_core.experiments.plates import draw

VALUES = st.lists(st.floats(allow_nan=True, allow_infinity=False, width=32), min_size=1, max_size=6)


@given(VALUES, st.sampled_from(["line", "points", "bars"]), st.booleans())
def test_a_chart_is_the_same_after_json(values, style, has_band):
    y = np.array(values)
    band = {"low": y - 1, "high": y + 1} if has_band else {}
    chart = Chart("t", "x [m]", "y [cm]", (Series("s", np.arange(len(y), dtype=float), y, style, **band),), log_y=True)
    again = chart_from_json(json.loads(json.dumps(chart.to_json(), allow_nan=False)))
    assert isinstance(again, Chart)
    assert (again.title, again.x_label, again.y_label, again.log_y) == ("t", "x [m]", "y [cm]", True)
    np.testing.assert_array_equal(again.series[0].y, y)
    assert again.series[0].style == style
    assert (again.series[0].low is not None) == has_band


def test_a_map_is_the_same_after_json():
    values = np.array([[1.0, np.nan], [3.0, 4.0], [5.0, 6.0]])
    chart = HeatMap("m", "x", "y", "z", np.array([1.0, 2.0]), np.array([1.0, 2.0, 3.0]), values)
    again = chart_from_json(json.loads(json.dumps(chart.to_json(), allow_nan=False)))
    assert isinstance(again, HeatMap)
    np.testing.assert_array_equal(again.values, values)


def test_columns_of_other_lengths_are_refused():
    with pytest.raises(GeometryError, match="different lengths"):
        Series("s", np.zeros(3), np.zeros(2))
    with pytest.raises(GeometryError, match="values on 2x3"):
        HeatMap("m", "x", "y", "z", np.zeros(3), np.zeros(2), np.zeros((3, 2)))


def test_drawings_are_files_and_the_same_bytes_for_the_same_numbers(tmp_path):
    y = np.array([1.0, 4.0, 2.0])
    x = np.arange(3.0)
    rows = (Series("a", x, y, "line", y - 1, y + 1), Series("b", x, y, "points"), Series("c", x, y, "bars"))
    drawings = {
        "chart": Chart("chart", "x", "y", rows),
        "map": HeatMap("map", "x", "y", "z", x, x, np.outer(y, y)),
    }
    for name, drawing in drawings.items():
        draw(drawing, tmp_path / f"{name}.svg")
        draw(drawing, tmp_path / f"{name}-again.svg")
        content = (tmp_path / f"{name}.svg").read_text()
        assert f">{name}<" in content
        assert content == (tmp_path / f"{name}-again.svg").read_text()
