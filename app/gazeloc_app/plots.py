"""Charts of the core, drawn with plotly."""

from __future__ import annotations

import plotly.graph_objects as go

from gazeloc_app.palette import CHART_GRID, CHART_TEXT, CLEAR, SERIES, hexadecimal
from gazeloc_core.charts.values import Chart, Drawing, HeatMap, Series


def to_plotly(drawing: Drawing) -> go.Figure:
    """The chart as a plotly figure for a narrow panel."""
    figure = go.Figure()
    if isinstance(drawing, HeatMap):
        figure.add_trace(
            go.Heatmap(
                x=drawing.x,
                y=drawing.y,
                z=drawing.values,
                colorscale="Viridis",
                colorbar={"title": drawing.z_label},
                hoverongaps=False,
            )
        )
    else:
        for number, row in enumerate(drawing.series):
            _add(figure, row, hexadecimal(SERIES[number % len(SERIES)]))
    figure.update_layout(
        title={"text": drawing.title, "font": {"size": 13}},
        xaxis_title=drawing.x_label,
        yaxis_title=drawing.y_label,
        margin={"l": 50, "r": 10, "t": 40, "b": 40},
        legend={"orientation": "h", "y": -0.2},
        font={"size": 11, "color": hexadecimal(CHART_TEXT)},
        template="plotly_white",
        paper_bgcolor=CLEAR,
        plot_bgcolor=CLEAR,
        modebar={"remove": ["zoom", "pan", "select", "lasso", "zoomIn", "zoomOut", "autoScale", "resetScale"]},
    )
    figure.update_xaxes(gridcolor=CHART_GRID, zerolinecolor=CHART_GRID)
    figure.update_yaxes(gridcolor=CHART_GRID, zerolinecolor=CHART_GRID)
    if isinstance(drawing, Chart) and drawing.log_y:
        figure.update_yaxes(type="log")
    return figure


def _add(figure: go.Figure, row: Series, color: str) -> None:
    if row.low is not None and row.high is not None:
        outline = [*row.high, *row.low[::-1]]
        figure.add_trace(
            go.Scatter(
                x=[*row.x, *row.x[::-1]], y=outline, fill="toself", fillcolor=color, opacity=0.15,
                line={"width": 0}, hoverinfo="skip", showlegend=False,
            )
        )  # fmt: skip
    if row.style == "bars":
        figure.add_trace(go.Bar(x=row.x, y=row.y, name=row.name, marker={"color": color}))
    else:
        mode = "markers" if row.style == "points" else "lines"
        figure.add_trace(
            go.Scatter(x=row.x, y=row.y, name=row.name, mode=mode, marker={"size": 4}, line={"color": color})
        )
