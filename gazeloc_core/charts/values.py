"""Charts as plain values: what is drawn, not with what. The app draws them with plotly, reports with matplotlib."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

from gazeloc_core.arrays import Floats, frozen
from gazeloc_core.errors import GeometryError

Style = Literal["line", "points", "bars"]


@dataclass(frozen=True, eq=False)
class Series:
    """One named row of N values `y` over `x`; `low` and `high` (N,) bound a band around it (its spread)."""

    name: str
    x: Floats
    y: Floats
    style: Style = "line"
    low: Floats | None = None
    high: Floats | None = None

    def __post_init__(self) -> None:
        for name in ("x", "y", "low", "high"):
            values = getattr(self, name)
            if values is not None:
                object.__setattr__(self, name, frozen(values))
        if any(values is not None and len(values) != len(self.x) for values in (self.y, self.low, self.high)):
            raise GeometryError(f"The series {self.name!r} has columns of different lengths.")


@dataclass(frozen=True, eq=False)
class Chart:
    """Series over one axis; the labels carry the units."""

    title: str
    x_label: str
    y_label: str
    series: tuple[Series, ...]
    log_y: bool = False

    def to_json(self) -> dict[str, Any]:
        """A JSON object that `chart_from_json` reads."""
        rows = [
            {
                "name": row.name,
                "style": row.style,
                **{
                    name: None if getattr(row, name) is None else _numbers(getattr(row, name))
                    for name in ("x", "y", "low", "high")
                },
            }
            for row in self.series
        ]
        labels = {name: getattr(self, name) for name in ("title", "x_label", "y_label", "log_y")}
        return {"kind": "chart", **labels, "series": rows}


@dataclass(frozen=True, eq=False)
class HeatMap:
    """`values` (len(y), len(x)) over a grid, NaN where there is none; `z_label` names what they are."""

    title: str
    x_label: str
    y_label: str
    z_label: str
    x: Floats
    y: Floats
    values: Floats

    def __post_init__(self) -> None:
        for name in ("x", "y", "values"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        if self.values.shape != (len(self.y), len(self.x)):
            raise GeometryError(
                f"The map {self.title!r} has {self.values.shape} values on {len(self.y)}x{len(self.x)}."
            )

    def to_json(self) -> dict[str, Any]:
        """A JSON object that `chart_from_json` reads."""
        labels = {name: getattr(self, name) for name in ("title", "x_label", "y_label", "z_label")}
        values = [_numbers(row) for row in self.values]
        return {"kind": "map", **labels, "x": _numbers(self.x), "y": _numbers(self.y), "values": values}


Drawing: TypeAlias = Chart | HeatMap


def chart_from_json(value: Mapping[str, Any]) -> Drawing:
    """The chart of `to_json`; a garbled one raises KeyError, TypeError or ValueError."""
    if value["kind"] == "map":
        title, x_label, y_label, z_label = (str(value[name]) for name in ("title", "x_label", "y_label", "z_label"))
        values = frozen([_array(row) for row in value["values"]])
        return HeatMap(title, x_label, y_label, z_label, _array(value["x"]), _array(value["y"]), values)
    rows = tuple(
        Series(
            row["name"],
            _array(row["x"]),
            _array(row["y"]),
            row["style"],
            None if row["low"] is None else _array(row["low"]),
            None if row["high"] is None else _array(row["high"]),
        )
        for row in value["series"]
    )
    return Chart(str(value["title"]), str(value["x_label"]), str(value["y_label"]), rows, bool(value["log_y"]))


def _numbers(values: Floats) -> list[float | None]:
    """JSON knows neither NaN nor infinity: both are null, drawn as gaps."""
    return [float(value) if abs(value) < float("inf") else None for value in values]


def _array(values: Sequence[float | None]) -> Floats:
    return frozen([float("nan") if value is None else float(value) for value in values])
