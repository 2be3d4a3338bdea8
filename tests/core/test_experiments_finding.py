"""Findings are written as CSV with their origin, charts and pictures, and read back into one report."""

import csv
import json

import numpy as np

from gazeloc_core.charts.values import Chart, Series
from gazeloc_core.experiments.finding import Finding, Provenance, inputs_of, write_finding, write_report

ORIGIN = Provenance(commit="abc1234", version="0.1.0", size="small", inputs="in")


def finding() -> Finding:
    rows = [
        {"method": "sfm", "position_cm": 0.5, "share": float("nan")},
        {"method": "tags", "position_cm": float("inf"), "note": "a, b"},
    ]
    chart = Chart("c", "x", "y", (Series("s", np.arange(2.0), np.arange(2.0)),))
    return Finding(
        text="It was found.",
        tables={"methods": rows},
        charts={"errors": chart},
        pictures={"room": np.full((8, 9, 3), 200, np.uint8)},
    )


def test_a_csv_names_its_commit_and_keeps_every_value(tmp_path):
    write_finding(tmp_path, "table", "A table", finding(), ORIGIN)
    first, *rest = (tmp_path / "table-methods.csv").read_text().splitlines()
    assert json.loads(first.removeprefix("# ")) == {"commit": "abc1234", "gazeloc": "0.1.0", "size": "small"}
    assert list(csv.DictReader(rest)) == [
        {"method": "sfm", "position_cm": "0.5", "share": "", "note": ""},
        {"method": "tags", "position_cm": "inf", "share": "", "note": "a, b"},
    ]


def test_what_is_there_is_known_by_its_inputs(tmp_path):
    assert inputs_of(tmp_path, "table") is None
    write_finding(tmp_path, "table", "A table", finding(), ORIGIN)
    assert inputs_of(tmp_path, "table") == "in"


def test_the_report_holds_every_finding_in_order_with_its_table_and_pictures(tmp_path):
    for name in ("b", "a"):
        write_finding(tmp_path, name, f"Title {name}", finding(), ORIGIN)
    text = write_report(tmp_path, ("b", "missing", "a")).read_text()
    assert text.index("## Title b") < text.index("## Title a")
    assert "missing" not in text
    assert "| sfm | 0.5 |" in text
    for part in ("b-errors.svg", "b-room.jpg", "b-methods.csv", "Commit abc1234, size small."):
        assert part in text
    for path in ("b-errors.svg", "b-room.jpg", "b-methods.csv"):
        assert (tmp_path / path).stat().st_size > 0
