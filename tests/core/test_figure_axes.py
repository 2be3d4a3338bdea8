"""Every axis of the recording's figures says what it is, with its unit."""

from types import SimpleNamespace

import numpy as np
import pytest

from gazeloc_core.charts.values import Series
from gazeloc_core.stages.figures import angle_chart, count_chart, error_chart

VIEWS = SimpleNamespace(device="glasses")
ANALYSIS = SimpleNamespace(
    tag_id=np.array([3, 3, 4]),
    frame_index=np.arange(3),
    distance_error_m=np.zeros(3),
    distance_m=np.ones(3),
    euler_deg=np.zeros((3, 3)),
)
CHARTS = (
    error_chart(VIEWS, ANALYSIS, 3),
    angle_chart(VIEWS, ANALYSIS, 3),
    count_chart((Series("exact", np.array([3.0]), np.array([1.0])),)),
)


@pytest.mark.parametrize("chart", CHARTS, ids=lambda chart: chart.title)
def test_axes_have_labels_and_lengths_and_angles_their_unit(chart):
    assert chart.x_label in ("frame", "keypoints"), "numbers of things need no unit"
    assert any(unit in chart.y_label for unit in ("[m]", "[cm]", "[°]"))
    assert len(chart.series[0].x) in (1, 2), "only of the tag that was asked for"
