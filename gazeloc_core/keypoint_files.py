"""Keypoints from and for other programs' files.

| file | holds | source |
|---|---|---|
| JSON of ours | whole pairs, with the clicks in frames | `KeypointSet.to_json`, as in the project folder |
| CSV | whole pairs without clicks: name, enabled, scan_x_m .. scan_z_m, sfm_x .. sfm_z; cells may be empty | ours |
| CloudCompare's picked points | one side: `x,y,z`, `index,x,y,z`, `label,x,y,z` or both | its picking list |
| Stray's `keypoints.json` | one side: {"keypoints": [{"position": [x, y, z]}, ...]} | Stray's scene format |

What is read is a `KeypointSet` with keys of its own; `merged` brings it into the keypoints that are there. The frame
`scan` is the scan file's own, in metres, so points picked on that file in another program fit as they are.
"""

from __future__ import annotations

import csv
import io
import json
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Literal

from gazeloc_core.errors import InputError
from gazeloc_core.keypoints import KeypointPair, KeypointSet, Point

SideName = Literal["scan", "sfm"]
COLUMNS = ("name", "enabled", "scan_x_m", "scan_y_m", "scan_z_m", "sfm_x", "sfm_y", "sfm_z")
MOST_PAIRS = 5000
MOST_BYTES = 4_000_000
MOST_NAME = 60
FARTHEST = 1e6
"""Coordinates beyond this are not of a room, in whatever unit."""
_REMEDY = "export it again, or choose a file of keypoints (JSON, CSV, CloudCompare's list, Stray's keypoints.json)"


def read_keypoints(name: str, content: bytes, side: SideName) -> KeypointSet:
    """The keypoints in a file of any of the formats above; `side` is that of formats which hold only one.

    Raises:
        InputError: with the file's `name` and the row, if it is none of them, is garbled, or holds nothing.
    """
    if len(content) > MOST_BYTES:
        raise InputError.of(name, f"the file has {len(content) / 1e6:.1f} MB, keypoints have less than 4", _REMEDY)
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError.of(name, f"the file is not UTF-8 text (byte {error.start})", _REMEDY) from error
    if text.lstrip()[:1] in ("{", "["):
        pairs = _from_json(name, text, side)
    elif re.match(r"\s*name\s*,\s*enabled\s*,", text):
        pairs = _from_csv(name, text)
    else:
        pairs = _from_list(name, text, side)
    if not pairs:
        raise InputError.of(name, "the file holds no keypoint", _REMEDY)
    if len(pairs) > MOST_PAIRS:
        raise InputError.of(name, f"the file holds {len(pairs)} keypoints, at most {MOST_PAIRS} can be taken", _REMEDY)
    return KeypointSet(tuple(replace(pair, key=f"k{i}") for i, pair in enumerate(pairs, start=1)))


def merged(present: KeypointSet, read: KeypointSet) -> KeypointSet:
    """The keypoints with those that were read: a pair of the same name gets the sides that were read, others are added.

    So the two sides of pairs may come from two lists, and a list that is read twice changes nothing the second time.
    """
    for pair in read:
        same = next((known for known in present if known.name == pair.name), None)
        if same is None:
            present = present.add(replace(pair, key=present.next_key()))
            continue
        fields: dict[str, Any] = {}
        if pair.scan is not None or pair.scan_sightings:
            fields |= {"scan": pair.scan, "scan_sightings": pair.scan_sightings, "scan_sigma": pair.scan_sigma}
        if pair.sfm is not None or pair.sightings:
            fields |= {"sfm": pair.sfm, "sightings": pair.sightings, "sfm_sigma": pair.sfm_sigma}
        present = present.change(same.key, **fields)
    return present


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


def to_cloudcompare_text(keypoints: KeypointSet, side: SideName) -> str:
    """One side as CloudCompare's list `label,x,y,z`; commas in names become spaces."""
    named = [(pair.name, getattr(pair, side)) for pair in keypoints]
    rows = [f"{' '.join(name.replace(',', ' ').split())},{p[0]!r},{p[1]!r},{p[2]!r}" for name, p in named if p]
    return "".join(f"{row}\n" for row in rows)


def to_stray_text(keypoints: KeypointSet, side: SideName) -> str:
    """One side as Stray's `keypoints.json`, which has no names."""
    points = [point for pair in keypoints if (point := getattr(pair, side)) is not None]
    return json.dumps({"keypoints": [{"position": list(point)} for point in points]}, indent=1) + "\n"


Writer = Callable[[KeypointSet], str]
WRITERS: dict[str, tuple[str, Writer]] = {
    "json": (".json", to_json_text),
    "csv": (".csv", to_csv_text),
    "cloudcompare-scan": (".txt", lambda keypoints: to_cloudcompare_text(keypoints, "scan")),
    "cloudcompare-sfm": (".txt", lambda keypoints: to_cloudcompare_text(keypoints, "sfm")),
    "stray-scan": (".json", lambda keypoints: to_stray_text(keypoints, "scan")),
    "stray-sfm": (".json", lambda keypoints: to_stray_text(keypoints, "sfm")),
}
"""Formats by name: the file's ending, and what makes its text."""


def _from_json(name: str, text: str, side: SideName) -> list[KeypointPair]:
    try:
        value = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError.of(name, f"the file is not valid JSON ({error})", _REMEDY) from error
    if isinstance(value, dict):
        entries = value.get("keypoints")
        if not isinstance(entries, list) or not all(isinstance(e, dict) and "position" in e for e in entries):
            raise InputError.of(name, "the JSON object holds no list “keypoints” of positions", _REMEDY)
        return [
            _one_sided(f"Point {i}", _point(name, f"keypoint {i}", entry["position"]), side)
            for i, entry in enumerate(entries, start=1)
        ]
    try:
        pairs = KeypointSet.from_json(value).pairs
    except (InputError, AttributeError) as error:
        raise InputError.of(name, f"the keypoints are garbled ({error})", _REMEDY) from error
    for pair in pairs:
        for point in (pair.scan, pair.sfm):
            if point is not None:
                _point(name, f"keypoint {pair.name!r}", point)
        clicks = [(s.frame_index, s.x_px, s.y_px) for s in (*pair.sightings, *pair.scan_sightings)]
        sigmas = [sigma for sigma in (pair.sfm_sigma, pair.scan_sigma) if sigma is not None]
        if not all(map(math.isfinite, [*sum(clicks, ()), *sigmas])) or any(click[0] < 0 for click in clicks):
            raise InputError.of(name, f"a click of keypoint {pair.name!r} is not a pixel of a frame", _REMEDY)
    return [replace(pair, name=_name(pair.name, pair.key)) for pair in pairs]


def _from_csv(name: str, text: str) -> list[KeypointPair]:
    try:
        rows = [[cell.strip() for cell in row] for row in csv.reader(io.StringIO(text, newline="")) if row]
    except csv.Error as error:
        raise InputError.of(name, f"the file is not CSV ({error})", _REMEDY) from error
    if tuple(rows[0]) != COLUMNS:
        raise InputError.of(name, f"the header is {','.join(rows[0])[:80]}, not {','.join(COLUMNS)}", _REMEDY)
    pairs = []
    for number, row in enumerate(rows[1:], start=2):
        if len(row) != len(COLUMNS):
            problem = f"row {number} has {len(row)} values, the header {len(COLUMNS)}"
            raise InputError.of(name, problem, _REMEDY)
        if row[1] not in ("0", "1"):
            raise InputError.of(name, f"row {number}: enabled is {row[1][:20]!r}, not 0 or 1", _REMEDY)
        scan, sfm = (_point(name, f"row {number}", cells) if any(cells) else None for cells in (row[2:5], row[5:8]))
        label = _name(row[0], f"Point {number - 1}")
        pairs.append(KeypointPair("", label, scan=scan, sfm=sfm, enabled=row[1] == "1"))
    return pairs


def _from_list(name: str, text: str, side: SideName) -> list[KeypointPair]:
    pairs: list[KeypointPair] = []
    for number, line in enumerate(text.splitlines(), start=1):
        row = line.strip()
        if not row or row.startswith(("#", "//")):
            continue
        cells = [cell.strip() for cell in re.split(r"[,;\t]" if re.search(r"[,;\t]", row) else r"\s+", row)]
        if len(cells) < 3:
            raise InputError.of(name, f"line {number} has no three coordinates ({row[:40]!r})", _REMEDY)
        before = [cell for cell in cells[:-3] if cell]
        label = next((cell for cell in before if not cell.isdigit()), "")
        named = label or (f"Point {before[0]}" if before else f"Point {len(pairs) + 1}")
        pairs.append(_one_sided(_name(named, ""), _point(name, f"line {number}", cells[-3:]), side))
    return pairs


def _one_sided(label: str, point: Point, side: SideName) -> KeypointPair:
    return KeypointPair("", label, scan=point) if side == "scan" else KeypointPair("", label, sfm=point)


def _name(label: str, otherwise: str) -> str:
    return (" ".join(label.split()) or otherwise)[:MOST_NAME]


def _point(name: str, where: str, values: Any) -> Point:
    if not isinstance(values, Sequence) or isinstance(values, str) or len(values) != 3:
        raise InputError.of(name, f"{where} has no three coordinates", _REMEDY)
    try:
        x, y, z = (float(value) for value in values)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError.of(name, f"{where}: {values!r} are not three numbers"[:120], _REMEDY) from error
    if not all(math.isfinite(value) and abs(value) <= FARTHEST for value in (x, y, z)):
        raise InputError.of(name, f"{where}: {values!r} is no place in a room"[:120], _REMEDY)
    return x, y, z
