"""What an experiment found: tables, charts and pictures with a paragraph, and how they are written to a folder."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

import cv2

from gazeloc_core.arrays import Bytes
from gazeloc_core.charts.values import Drawing
from gazeloc_core.experiments.plates import draw
from gazeloc_core.storage.files import read_json, write_json_atomically

Row: TypeAlias = Mapping[str, Any]
_JPEG_QUALITY = 88


@dataclass(frozen=True, kw_only=True)
class Finding:
    """Tables (rows with the same keys, units in the keys), charts and RGB pictures by name, and what they say."""

    text: str
    tables: Mapping[str, Sequence[Row]] = field(default_factory=dict)
    charts: Mapping[str, Drawing] = field(default_factory=dict)
    pictures: Mapping[str, Bytes] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Provenance:
    """Where numbers come from: the commit (with a mark where files were changed since), version and size."""

    commit: str
    version: str
    size: str
    inputs: str
    """Hash of what the experiment was given; another one makes it run again."""


def write_finding(folder: Path, name: str, title: str, finding: Finding, provenance: Provenance) -> None:
    """Write `NAME-*.csv`, `NAME-*.svg`, `NAME-*.jpg` and, last, `NAME.json` with the text: its presence says done."""
    folder.mkdir(parents=True, exist_ok=True)
    for table, rows in finding.tables.items():
        write_csv(folder / f"{name}-{table}.csv", rows, provenance)
    for chart, drawing in finding.charts.items():
        draw(drawing, folder / f"{name}-{chart}.svg")
    for picture, rgb in finding.pictures.items():
        bgr = cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR)
        cv2.imwrite(str(folder / f"{name}-{picture}.jpg"), bgr, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    write_json_atomically(
        folder / f"{name}.json",
        {
            "title": title,
            "text": finding.text,
            "tables": [f"{name}-{table}.csv" for table in finding.tables],
            "charts": [f"{name}-{chart}.svg" for chart in finding.charts],
            "pictures": [f"{name}-{picture}.jpg" for picture in finding.pictures],
            "commit": provenance.commit,
            "size": provenance.size,
            "inputs": provenance.inputs,
        },
    )


def inputs_of(folder: Path, name: str) -> str | None:
    """The inputs of the finding that is there; None where there is none."""
    path = folder / f"{name}.json"
    return str(read_json(path, "an experiment's finding").get("inputs")) if path.is_file() else None


def write_csv(path: Path, rows: Sequence[Row], provenance: Provenance) -> None:
    """One line that says where the numbers come from (behind #), one with the names, then the rows."""
    with path.open("w", newline="", encoding="utf-8") as file:
        facts = {"commit": provenance.commit, "gazeloc": provenance.version, "size": provenance.size}
        file.write(f"# {json.dumps(facts)}\n")
        names = list(dict.fromkeys(name for row in rows for name in row))
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(names)
        writer.writerows([_cell(row.get(name)) for name in names] for row in rows)


def write_report(folder: Path, order: Sequence[str]) -> Path:
    """README.md of the folder: every finding that is there, in this order, with its tables and pictures."""
    parts = ["# Experiments", "", "Made by `make experiments`; each CSV names the commit that it comes from.", ""]
    for name in order:
        path = folder / f"{name}.json"
        if path.is_file():
            parts += _section(folder, read_json(path, "an experiment's finding"))
    target = folder / "README.md"
    target.write_text("\n".join(parts) + "\n", encoding="utf-8")
    return target


def _section(folder: Path, value: Mapping[str, Any]) -> list[str]:
    parts = [f"## {value['title']}", "", str(value["text"]), ""]
    for table in value["tables"]:
        rows = _read_rows(folder / table)
        if len(rows) <= 40:
            head, *body = rows
            parts += [_markdown(head), _markdown(["---"] * len(head)), *map(_markdown, body), ""]
        parts += [f"[{table}]({table})", ""]
    parts += [f"![{Path(file).stem}]({file})\n" for file in (*value["charts"], *value["pictures"])]
    return [*parts, f"Commit {value['commit']}, size {value['size']}.", ""]


def _read_rows(path: Path) -> list[list[str]]:
    with path.open(newline="", encoding="utf-8") as file:
        return [row for row in csv.reader(file) if row and not row[0].startswith("#")]


def _markdown(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _cell(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, float):
        return f"{value:.6g}" if math.isfinite(value) else ("inf" if value > 0 else "")
    return str(value)
