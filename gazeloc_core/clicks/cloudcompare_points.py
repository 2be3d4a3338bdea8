"""CloudCompare's points as text: what is picked there, and the table of pairs that its alignment prints.

- The lists of its tool "Point list picking" (https://www.cloudcompare.org/doc/wiki/index.php/Point_list_picking):
  `x,y,z`, `index,x,y,z` or `label,x,y,z`, one side each.
- The table of "Align (point pairs picking)", which reads no file (issue CloudCompare#1352) and writes its pairs to the
  console (issue CloudCompare#1921), a time before each line:

    [22:21:09] ; Ref.name; Ref.x; Ref.y; Ref.z; Aligned.name; Aligned.x; ...; Delta X; Delta Y; Delta Z; Distance
    [22:21:09] ;R0; 558.046; 486.641; 0.939167; A0; 558.482; 486.44; 1.17604; 0.436218; -0.201324; 0.236876; 0.535657

  "Aligned" is where the point lies *after* the alignment, no longer a place of the cloud that was aligned: only the
  reference's side is taken. A table of pairs without Delta and Distance, such as LiDAR360's homologous points
  (`ID, ref_X, ref_Y, ref_Z, align_X, align_Y, align_Z`), gives both sides.

Both tools name their points A0, A1, ... and R0, R1, ...: what has the same number is the same keypoint.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from gazeloc_core.clicks.keypoint_cells import REMEDY, SideName, name_of, one_sided, point_of
from gazeloc_core.errors import InputError
from gazeloc_core.keypoints import KeypointPair, KeypointSet

_TIME = re.compile(r"^\s*\[[\d:.]+\]\s*")
_LABEL = re.compile(r"([AR])(\d{1,6})")
_COORDINATES = re.compile(r"[xyz]([ _.(\[].*)?", re.IGNORECASE)
_LONGEST_HEADER = 400
_NAMES = ("ref.name", "name", "id", "label", "ref_name")


class _Columns(NamedTuple):
    """Where the columns of a table of pairs are; `aligned` is None where it holds no places of the aligned cloud."""

    least: int
    name: int | None
    reference: tuple[int, ...]
    aligned: tuple[int, ...] | None


def to_list(keypoints: KeypointSet, side: SideName) -> str:
    """One side as the list `label,x,y,z`; commas in names become spaces."""
    named = [(pair.name, getattr(pair, side)) for pair in keypoints]
    rows = [f"{' '.join(name.replace(',', ' ').split())},{p[0]!r},{p[1]!r},{p[2]!r}" for name, p in named if p]
    return "".join(f"{row}\n" for row in rows)


def is_table_of_pairs(text: str) -> bool:
    """Whether there is a header as above."""
    lines = (line for line in text.splitlines() if len(line) < _LONGEST_HEADER and "ref" in line.lower())
    return any(_columns(_cells(line)) for line in lines)


def from_table_of_pairs(file: str, text: str, side: SideName) -> list[KeypointPair]:
    """The pairs of a table; the reference's side is `side`.

    Raises:
        InputError: with the line, if it is garbled.
    """
    columns: _Columns | None = None
    pairs: list[KeypointPair] = []
    for number, line in enumerate(text.splitlines(), start=1):
        cells = _cells(line)
        if columns is None or not any(cells):
            columns = columns or _columns(cells)
            continue
        if _TIME.match(line) and not _TIME.sub("", line).lstrip().startswith(";"):
            continue  # something else that the console says
        if len(cells) < columns.least:
            raise InputError.of(file, f"line {number} has {len(cells)} values, the header {columns.least}", REMEDY)
        label = cells[columns.name] if columns.name is not None else ""
        reference = point_of(file, f"line {number}", [cells[i] for i in columns.reference])
        pair = one_sided(name_of(_numbered(label), f"Point {len(pairs) + 1}"), reference, side)
        if columns.aligned is not None:
            other = point_of(file, f"line {number}", [cells[i] for i in columns.aligned])
            scan, sfm = (reference, other) if side == "scan" else (other, reference)
            pair = KeypointPair("", pair.name, scan=scan, sfm=sfm)
        pairs.append(pair)
    return pairs


def from_list(file: str, text: str, side: SideName) -> list[KeypointPair]:
    """The points of a list of one side.

    Raises:
        InputError: with the line, if it has no three coordinates.
    """
    found: list[tuple[str, KeypointPair]] = []
    for number, line in enumerate(text.splitlines(), start=1):
        row = line.strip()
        if not row or row.startswith(("#", "//")):
            continue
        cells = [cell.strip() for cell in re.split(r"[,;\t]" if re.search(r"[,;\t]", row) else r"\s+", row)]
        if not found and len(cells) >= 3 and all(_COORDINATES.fullmatch(cell) for cell in cells[-3:]):
            continue  # a header
        if len(cells) < 3:
            raise InputError.of(file, f"line {number} has no three coordinates ({row[:40]!r})", REMEDY)
        before = [cell for cell in cells[:-3] if cell]
        label = next((cell for cell in before if not cell.isdigit()), "")
        named = label or (f"Point {before[0]}" if before else f"Point {len(found) + 1}")
        found.append((named, one_sided(name_of(named, ""), point_of(file, f"line {number}", cells[-3:]), side)))
    if len({match[1] if (match := _LABEL.fullmatch(label)) else None for label, _ in found}) != 1:
        return [pair for _, pair in found]  # people's own names, or A and R in one list
    return [
        one_sided(name_of(_numbered(label), ""), getattr(pair, side), side) if _LABEL.fullmatch(label) else pair
        for label, pair in found
    ]


def _numbered(label: str) -> str:
    """A0 and R0 are one keypoint."""
    match = _LABEL.fullmatch(label.strip())
    return f"Pair {match[2]}" if match else label


def _cells(line: str) -> list[str]:
    text = _TIME.sub("", line).strip()
    cells = [cell.strip() for cell in re.split(r"[;,\t]", text)]
    return cells[1:] if cells[0] == "" and len(cells) > 1 else cells


def _columns(cells: list[str]) -> _Columns | None:
    heads = [re.sub(r"[ _]+", ".", cell.lower()) for cell in cells]
    places = []
    for who in (r"ref(erence)?", r"align(ed)?"):
        found = [
            next((i for i, head in enumerate(heads) if re.fullmatch(rf"{who}\.{axis}", head)), -1) for axis in "xyz"
        ]
        places.append(tuple(found))
    if any(-1 in place for place in places):
        return None
    is_moved = any(head.startswith(("delta", "distance")) for head in heads)
    name = next((i for i, head in enumerate(heads) if head in _NAMES), None)
    return _Columns(max(*places[0], *places[1]) + 1, name, places[0], None if is_moved else places[1])
