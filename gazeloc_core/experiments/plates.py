"""Charts drawn for reports, as SVG by matplotlib: small, sharp, and the same bytes for the same numbers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gazeloc_core.charts.values import Chart, Drawing, HeatMap

_STYLE: dict[Any, Any] = {
    "svg.hashsalt": "gazeloc",
    "svg.fonttype": "none",
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.alpha": 0.25,
}
_MANY_POINTS = 400


def draw(drawing: Drawing, path: Path) -> None:
    """Write one chart."""
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(6.4, 3.6), layout="constrained")
        axes = figure.add_subplot()
        axes.set(title=drawing.title, xlabel=drawing.x_label, ylabel=drawing.y_label)
        if isinstance(drawing, HeatMap):
            _draw_map(figure, axes, drawing)
        else:
            _draw_series(axes, drawing)
        figure.savefig(path, metadata={"Date": None, "Creator": None})


def _draw_series(axes: Axes, chart: Chart) -> None:
    bars = [row for row in chart.series if row.style == "bars"]
    for row in chart.series:
        if row.style == "bars":
            width = 0.8 / len(bars) * (float(np.diff(np.unique(row.x)).min()) if len(np.unique(row.x)) > 1 else 1.0)
            shift = (bars.index(row) - (len(bars) - 1) / 2) * width
            drawn = axes.bar(row.x + shift, row.y, width, label=row.name).patches
            color: Any = drawn[0].get_facecolor() if drawn else None
        elif row.style == "points":
            size = 4 if len(row.x) > _MANY_POINTS else 12
            points = axes.scatter(row.x, row.y, s=size, alpha=0.7, label=row.name, linewidths=0)
            color = points.get_facecolor()[0] if len(row.x) else None
        else:
            (curve,) = axes.plot(row.x, row.y, label=row.name, linewidth=1.4)
            color = curve.get_color()
        if row.low is not None and row.high is not None:
            axes.fill_between(row.x, row.low, row.high, color=color, alpha=0.18, linewidth=0)
    if chart.log_y:
        axes.set_yscale("log")
    if len(chart.series) > 1 or chart.series[0].name:
        axes.legend(frameon=False, fontsize=8)


def _draw_map(figure: Figure, axes: Axes, chart: HeatMap) -> None:
    axes.grid(False)
    x, y = np.arange(len(chart.x)), np.arange(len(chart.y))
    image = axes.imshow(chart.values, origin="lower", aspect="auto", cmap="viridis")
    axes.set_xticks(x, [f"{value:g}" for value in chart.x])
    axes.set_yticks(y, [f"{value:g}" for value in chart.y])
    figure.colorbar(image, ax=axes, label=chart.z_label)
    middle = float(np.nanmean(chart.values)) if np.isfinite(chart.values).any() else 0.0
    for row, column in np.argwhere(np.isfinite(chart.values)):
        value = float(chart.values[row, column])
        color = "white" if value < middle else "black"
        axes.text(column, row, f"{value:.2g}", ha="center", va="center", fontsize=7, color=color)
