"""Keypoints from and for other programs' files.

| file | holds | source |
|---|---|---|
| JSON of ours | whole pairs, with the clicks in frames | `KeypointSet.to_json`, as in the project folder |
| CSV | pairs without clicks: name, enabled, scan_x_m .. scan_z_m, sfm_x .. sfm_z, any order; one side will do | ours |
| CloudCompare's picked points | one side: `x,y,z`, `index,x,y,z`, `label,x,y,z` or both | cloudcompare_points.py |
| tables of pairs | the reference's side, or both: CloudCompare's console, LiDAR360 | cloudcompare_points.py |
| Stray's `keypoints.json` | one side: {"keypoints": [{"position": [x, y, z]}, ...]} | Stray's scene format |

What is read is a `KeypointSet` with keys of its own; `merged` brings it into the keypoints that are there. The frame
`scan` has the scan file's own axes, so points picked on that file in another program fit. Our own files are in metres;
those of other programs are in the unit of the scan file, which may be millimetres.
"""

from __future__ import annotations

import csv
import io
import itertools
import json
import math
import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from gazeloc_core.arrays import Floats
from gazeloc_core.clicks import cloudcompare_points
from gazeloc_core.clicks.keypoint_cells import REMEDY, SideName, name_of, one_sided, point_of
from gazeloc_core.errors import InputError
from gazeloc_core.keypoints import KeypointPair, KeypointSet, Point

SIDE_COLUMNS: dict[SideName, tuple[str, ...]] = {
    "scan": ("scan_x_m", "scan_y_m", "scan_z_m"),
    "sfm": ("sfm_x", "sfm_y", "sfm_z"),
}
COLUMNS = ("name", "enabled", *SIDE_COLUMNS["scan"], *SIDE_COLUMNS["sfm"])
_OUR_HEADER = re.compile(rf"\s*[^\n]*\b({'|'.join(COLUMNS[2:])})\b|\s*name\s*,\s*enabled\s*,", re.IGNORECASE)
MOST_PAIRS = 5000
MOST_BYTES = 4_000_000


def read_keypoints(name: str, content: bytes, side: SideName, metres_per_unit: float = 1.0) -> KeypointSet:
    """The keypoints in a file of any of the formats above.

    `side` is that of formats which hold only one, and of the reference in tables of pairs. `metres_per_unit` is that of
    the scan file (`RoomScan.metres_per_unit`).

    Raises:
        InputError: with the file's `name` and the row, if it is none of them, is garbled, or holds nothing.
    """
    if len(content) > MOST_BYTES:
        raise InputError.of(name, f"the file has {len(content) / 1e6:.1f} MB, keypoints have less than 4", REMEDY)
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError.of(name, f"the file is not UTF-8 text (byte {error.start})", REMEDY) from error
    is_ours = False
    if cloudcompare_points.is_table_of_pairs(text):
        pairs = cloudcompare_points.from_table_of_pairs(name, text, side)
    elif text.lstrip()[:1] in ("{", "["):
        pairs, is_ours = _from_json(name, text, side), text.lstrip()[0] == "["
    elif _OUR_HEADER.match(text):
        pairs, is_ours = _from_csv(name, text), True
    else:
        pairs = cloudcompare_points.from_list(name, text, side)
    if not pairs:
        raise InputError.of(name, "the file holds no keypoint", REMEDY)
    if len(pairs) > MOST_PAIRS:
        raise InputError.of(name, f"the file holds {len(pairs)} keypoints, at most {MOST_PAIRS} can be taken", REMEDY)
    read = KeypointSet(tuple(replace(pair, key=f"k{i}") for i, pair in enumerate(pairs, start=1)))
    return read if is_ours else _in_unit(read, metres_per_unit)


def far_outside(keypoints: KeypointSet, low: Floats, high: Floats) -> str:
    """A sentence where points on the scan lie far outside of the room between its corners (3,), else nothing."""
    points = np.array([pair.scan for pair in keypoints if pair.scan is not None]).reshape(-1, 3)
    reach = float(np.linalg.norm(high - low))
    outside = int((np.maximum(low - points, points - high).max(axis=1, initial=0.0) > reach).sum())
    if outside == 0:
        return ""
    return f" {outside} of them lie far outside of the scan: is that side right, and the list in the scan file's unit?"


def _in_unit(keypoints: KeypointSet, factor: float) -> KeypointSet:
    """The keypoints with the places on the scan multiplied; the very same for a factor of 1."""
    if factor == 1:
        return keypoints

    def scaled(point: Point | None) -> Point | None:
        return None if point is None else (factor * point[0], factor * point[1], factor * point[2])

    return KeypointSet(tuple(replace(pair, scan=scaled(pair.scan)) for pair in keypoints))


def merged(present: KeypointSet, read: KeypointSet) -> KeypointSet:
    """The keypoints with those that were read: a pair of the same name gets the sides that were read, others are added.

    So the two sides of pairs may come from two lists, and a list that is read twice changes nothing the second time.
    """
    pairs, key_of = {pair.key: pair for pair in present}, {pair.name: pair.key for pair in reversed(present.pairs)}
    new_keys = (f"k{number}" for number in itertools.count(int(present.next_key()[1:])))
    for pair in read:
        if pair.name not in key_of:
            key = key_of[pair.name] = next(new_keys)
            pairs[key] = replace(pair, key=key)
            continue
        fields: dict[str, Any] = {}
        if pair.scan is not None or pair.scan_sightings:
            fields |= {"scan": pair.scan, "scan_sightings": pair.scan_sightings, "scan_sigma": pair.scan_sigma}
        if pair.sfm is not None or pair.sightings:
            fields |= {"sfm": pair.sfm, "sightings": pair.sightings, "sfm_sigma": pair.sfm_sigma}
        pairs[key_of[pair.name]] = replace(pairs[key_of[pair.name]], **fields)
    return KeypointSet(tuple(pairs.values()))


def to_json_text(keypoints: KeypointSet) -> str:
    """Our JSON: everything that is known of the pairs."""
    return json.dumps(keypoints.to_json(), indent=1, allow_nan=False) + "\n"


def to_csv_text(keypoints: KeypointSet) -> str:
    """The pairs as CSV, a side that is missing as empty cells."""
    out = io.StringIO(newline="")
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(COLUMNS)
    for pair in keypoints:
        sides = [*(pair.scan or ("", "", "")), *(pair.sfm or ("", "", ""))]
        writer.writerow([pair.name, int(pair.enabled), *sides])
    return out.getvalue()


def to_stray_text(keypoints: KeypointSet, side: SideName) -> str:
    """One side as Stray's `keypoints.json`, which has no names."""
    points = [point for pair in keypoints if (point := getattr(pair, side)) is not None]
    return json.dumps({"keypoints": [{"position": list(point)} for point in points]}, indent=1) + "\n"


def keypoints_text(format: str, keypoints: KeypointSet, metres_per_unit: float = 1.0) -> str:
    """The text of a file in one of the `WRITERS`' formats: ours in metres, others in the unit of the scan file."""
    is_ours = format in ("json", "csv")
    return WRITERS[format][1](keypoints if is_ours else _in_unit(keypoints, 1 / metres_per_unit))


Writer = Callable[[KeypointSet], str]
WRITERS: dict[str, tuple[str, Writer]] = {
    "json": (".json", to_json_text),
    "csv": (".csv", to_csv_text),
    "cloudcompare-scan": (".txt", lambda keypoints: cloudcompare_points.to_list(keypoints, "scan")),
    "cloudcompare-sfm": (".txt", lambda keypoints: cloudcompare_points.to_list(keypoints, "sfm")),
    "stray-scan": (".json", lambda keypoints: to_stray_text(keypoints, "scan")),
    "stray-sfm": (".json", lambda keypoints: to_stray_text(keypoints, "sfm")),
}
"""Formats by name: the file's ending, and what makes its text."""


def _from_json(name: str, text: str, side: SideName) -> list[KeypointPair]:
    try:
        value = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError.of(name, f"the file is not valid JSON ({error})", REMEDY) from error
    if isinstance(value, dict):
        entries = value.get("keypoints")
        if not isinstance(entries, list) or not all(isinstance(e, dict) and "position" in e for e in entries):
            raise InputError.of(name, "the JSON object holds no list “keypoints” of positions", REMEDY)
        return [
            one_sided(f"Point {i}", point_of(name, f"keypoint {i}", entry["position"]), side)
            for i, entry in enumerate(entries, start=1)
        ]
    try:
        pairs = KeypointSet.from_json(value).pairs
    except (InputError, AttributeError) as error:
        raise InputError.of(name, f"the keypoints are garbled ({error})", REMEDY) from error
    for pair in pairs:
        for point in (pair.scan, pair.sfm):
            if point is not None:
                point_of(name, f"keypoint {pair.name!r}", point)
        clicks = [(s.frame_index, s.x_px, s.y_px) for s in (*pair.sightings, *pair.scan_sightings)]
        sigmas = [sigma for sigma in (pair.sfm_sigma, pair.scan_sigma) if sigma is not None]
        if not all(map(math.isfinite, [*sum(clicks, ()), *sigmas])) or any(click[0] < 0 for click in clicks):
            raise InputError.of(name, f"a click of keypoint {pair.name!r} is not a pixel of a frame", REMEDY)
    return [replace(pair, name=name_of(pair.name, pair.key)) for pair in pairs]


def _from_csv(name: str, text: str) -> list[KeypointPair]:
    try:
        rows = [[cell.strip() for cell in row] for row in csv.reader(io.StringIO(text, newline="")) if row]
    except csv.Error as error:
        raise InputError.of(name, f"the file is not CSV ({error})", REMEDY) from error
    header = _checked_header(name, [cell.lower() for cell in rows[0]])
    pairs = []
    for number, row in enumerate(rows[1:], start=2):
        if len(row) != len(header):
            problem = f"row {number} has {len(row)} values, the header {len(header)}"
            raise InputError.of(name, problem, REMEDY)
        pairs.append(_pair_of(name, number, dict(zip(header, row, strict=True))))
    return pairs


def _checked_header(name: str, header: list[str]) -> list[str]:
    """The columns, each known and once, and of each side that has one all three."""
    for column in header:
        if column not in COLUMNS:
            known = ", ".join(COLUMNS)
            raise InputError.of(name, f"the header has the column {column[:20]!r}, which is none of {known}", REMEDY)
        if header.count(column) > 1:
            raise InputError.of(name, f"the header has the column {column} twice", REMEDY)
    for columns in SIDE_COLUMNS.values():
        missing = set(columns) - set(header)
        if 0 < len(missing) < len(columns):
            raise InputError.of(name, f"the header has no column {min(missing)}", REMEDY)
    return header


def _pair_of(name: str, number: int, cells: dict[str, str]) -> KeypointPair:
    enabled = cells.get("enabled", "1")
    if enabled not in ("0", "1"):
        raise InputError.of(name, f"row {number}: enabled is {enabled[:20]!r}, not 0 or 1", REMEDY)
    places = {}
    for side, columns in SIDE_COLUMNS.items():
        values = [cells.get(column, "") for column in columns]
        places[side] = point_of(name, f"row {number}", values) if any(values) else None
    label = name_of(cells.get("name", ""), f"Point {number - 1}")
    return KeypointPair("", label, scan=places["scan"], sfm=places["sfm"], enabled=enabled == "1")
