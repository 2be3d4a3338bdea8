"""Tags to print: as many per page as fit at true size, with cut marks, what they are, and a ruler to check the printer.

Each tag keeps a white margin of one cell, which the detector needs. In the margin two ticks stand where the tag size
ends: the square between the corners that the detector reports.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gazeloc_core.arrays import Bools
from gazeloc_core.errors import InputError
from gazeloc_core.storage.export_files import starts_with, write_text_export
from gazeloc_core.tags.bitmaps import TagBitmap, tag_bitmap
from gazeloc_core.tags.detection import TagOptions, family_of
from gazeloc_core.tags.pdf_page import COURIER_ADVANCE, OURS, PageText, PdfPage, pdf_of

PAPERS_M = {
    "a5": (0.148, 0.210),
    "a4": (0.210, 0.297),
    "a3": (0.297, 0.420),
    "a2": (0.420, 0.594),
    "letter": (0.2159, 0.2794),
    "tabloid": (0.2794, 0.4318),
}
"""Width and height of the papers, in metres."""

MOST_TAGS = 1000
_EDGE_M = 0.005  # what printers cannot print on
_FOOT_M = 0.018
_LINE_M = 0.0002
_RULER_M = 0.1
_TEXT_M = 0.003

Rectangle = tuple[float, float, float, float]


@dataclass(frozen=True, kw_only=True)
class SheetOptions:
    """Which tags are printed, and on what."""

    ids: tuple[int, ...]
    """Ids of the tags."""
    size_m: float
    """Distance between the corners that the detector reports, in metres."""
    family: str = "tag36h11"
    """Tag family, e.g. tag36h11 or tagStandard41h12."""
    paper: str = "a4"
    """Paper: a5, a4, a3, a2, letter or tabloid, upright."""


def parse_ids(text: str) -> tuple[int, ...]:
    """The ids in a text like `0-9,12`, each once, in its order.

    Raises:
        InputError: if it is something else, or names more than 1000.
    """
    ids: dict[int, None] = {}
    for piece in text.replace(" ", "").split(","):
        match = re.fullmatch(r"(\d{1,6})(?:-(\d{1,6}))?", piece)
        first, last = (int(match[1]), int(match[2] or match[1])) if match else (1, 0)
        if last < first:
            raise InputError(f"The ids {text!r} cannot be read at {piece!r}; write them like 0-9,12.")
        if len(ids) + last - first >= MOST_TAGS:
            raise InputError(f"The ids {text!r} are more than {MOST_TAGS} tags; print fewer at a time.")
        ids |= dict.fromkeys(range(first, last + 1))
    return tuple(ids)


def size_note(family: str, size_m: float) -> str:
    """A sentence that says what on the printed tag is as long as the tag size."""
    edge = "outer" if tag_bitmap(family, 0).is_size_outer else "inner"
    return f"{1000 * size_m:g} mm is the {edge} edge of the black ring of {family}."


def tag_sheet(options: SheetOptions) -> list[PdfPage]:
    """The pages of a sheet.

    Raises:
        InputError: if the family, an id or the paper is unknown, or a tag does not fit on the paper.
    """
    family_of(TagOptions(family=options.family))
    bitmaps = {tag_id: tag_bitmap(options.family, tag_id) for tag_id in options.ids}
    if not bitmaps:
        raise InputError("There is no id to print; give at least one.")
    width, height = _paper(options.paper)
    cell = _margined(next(iter(bitmaps.values()))).shape[0]
    side = cell * _module(options, next(iter(bitmaps.values())))
    columns, rows = _grid(options, side, cell, width, height)
    places = [
        ((width - columns * side) / 2 + c * side, _EDGE_M + r * side) for r in range(rows) for c in range(columns)
    ]
    pages = []
    for start in range(0, len(options.ids), len(places)):
        shown = list(zip(options.ids[start : start + len(places)], places, strict=False))
        pages.append(_page(options, [(i, bitmaps[i], place) for i, place in shown], side, width, height))
    return pages


def sheet_pdf(options: SheetOptions) -> bytes:
    """The PDF file of a sheet; raises as `tag_sheet`."""
    return pdf_of(tag_sheet(options), f"{options.family} {1000 * options.size_m:g} mm")


def write_sheet(options: SheetOptions, path: Path) -> int:
    """Write the PDF file of a sheet; the number of its pages.

    Raises:
        InputError: as `tag_sheet`, or if the folder cannot be written or a file is there that GazeLoc did not write.
    """
    content = sheet_pdf(options).decode("ascii")
    write_text_export(path, content, starts_with(OURS))
    return content.count("/Type /Page ")


def _paper(name: str) -> tuple[float, float]:
    if name not in PAPERS_M:
        raise InputError(f"The paper {name!r} is unknown; use one of {', '.join(PAPERS_M)}.")
    return PAPERS_M[name]


def _module(options: SheetOptions, bitmap: TagBitmap) -> float:
    return options.size_m / bitmap.across


def _margined(bitmap: TagBitmap) -> Bools:
    """The cells with a ring of white ones around; families whose data lies outermost bring none."""
    return np.pad(bitmap.is_white, 0 if bitmap.is_size_outer else 1, constant_values=True)


def _grid(options: SheetOptions, side: float, cells: int, width: float, height: float) -> tuple[int, int]:
    """How many tags stand beside and above each other."""
    if not 0.005 <= options.size_m <= 5:
        raise InputError(f"A tag of {options.size_m:g} m cannot be printed; a tag is between 0.005 and 5 metres.")
    room_x, room_y = width - 2 * _EDGE_M, height - 2 * _EDGE_M - _FOOT_M
    columns, rows = int(room_x / side + 1e-6), int(room_y / side + 1e-6)
    if columns < 1 or rows < 1:
        most = min(room_x, room_y) * options.size_m / side
        raise InputError(
            f"A {options.family} of {options.size_m:g} m needs {side:.3f} m of paper with its white margin ({cells} "
            f"cells); {options.paper} takes {np.floor(1000 * most + 1e-6) / 1000:g} m at most, "
            "choose larger paper or smaller tags."
        )
    return columns, rows


def _page(
    options: SheetOptions,
    tags: Sequence[tuple[int, TagBitmap, tuple[float, float]]],
    side: float,
    width: float,
    height: float,
) -> PdfPage:
    ink: list[Rectangle] = []
    texts: list[PageText] = []
    marks: dict[Rectangle, None] = {}
    for tag_id, bitmap, (x, y) in tags:
        module = _module(options, bitmap)
        ink += _cells(_margined(bitmap), x, y, module)
        marks |= dict.fromkeys(_cut_marks(x, y, side, min(0.004, module)))
        ticks, text = _caption(options, tag_id, x, y + side, side, module)
        ink += ticks
        texts.append(text)
    ruler, words = _foot(options, width, height)
    rectangles = np.array([*ink, *marks, *ruler])
    return PdfPage(width, height, rectangles, (*texts, *words))


def _cells(is_white: Bools, x: float, y: float, module: float) -> list[Rectangle]:
    """Each row's runs of black cells."""
    found: list[Rectangle] = []
    for row, white in enumerate(is_white):
        steps = np.flatnonzero(np.diff(np.concatenate([[True], white, [True]]).astype(np.int8)))
        for a, b in steps.reshape(-1, 2).tolist():
            found.append((x + a * module, y + row * module, (b - a) * module, module))
    return found


def _cut_marks(x: float, y: float, side: float, length: float) -> list[Rectangle]:
    """An angle on the cutting lines in each corner of a tag's paper."""
    marks: list[Rectangle] = []
    for px, left in ((x, 0.0), (x + side, length)):
        for py, up in ((y, 0.0), (y + side, length)):
            marks.append((round(px - left, 9), round(py - _LINE_M / 2, 9), length, _LINE_M))
            marks.append((round(px - _LINE_M / 2, 9), round(py - up, 9), _LINE_M, length))
    return marks


def _caption(
    options: SheetOptions, tag_id: int, x: float, bottom: float, side: float, module: float
) -> tuple[list[Rectangle], PageText]:
    """In the margin under the tag, near the cut: ticks where the tag size ends, and between them what the tag is."""
    tick = 0.3 * module
    left, right = x + (side - options.size_m) / 2, x + (side + options.size_m) / 2
    ticks = [(at - _LINE_M / 2, bottom - 0.45 * module, _LINE_M, tick) for at in (left, right)]
    label = f"{options.family}  id {tag_id}  {1000 * options.size_m:g} mm"
    size = min(_TEXT_M, tick, 0.9 * options.size_m / (COURIER_ADVANCE * len(label)))
    text = PageText(0.0, bottom - 0.2 * module, size, label)
    centred = x + (side - text.width) / 2
    return ticks, PageText(centred, text.y, size, label)


def _foot(options: SheetOptions, width: float, height: float) -> tuple[list[Rectangle], list[PageText]]:
    """A ruler of 10 cm, and what to do with it."""
    x, y = (width - _RULER_M) / 2, height - _EDGE_M - 0.009
    ruler = [(x, y - _LINE_M, _RULER_M, _LINE_M)]
    ruler += [(x + 0.01 * i - _LINE_M / 2, y - 0.003, _LINE_M, 0.003) for i in range(11)]
    lines = [
        "This ruler is 100 mm long. If yours is not: print again at 100 % (actual size).",
        f"Between the ticks: {size_note(options.family, options.size_m)}",
        f"gazeloc new ... --tag-family {options.family} --tag-size {options.size_m:g}",
    ]
    size = min(_TEXT_M * 0.8, (width - 2 * _EDGE_M) / (COURIER_ADVANCE * max(map(len, lines))))
    below = [PageText(0.0, y + 0.003 * (k + 1), size, line) for k, line in enumerate(lines)]
    return ruler, [PageText((width - text.width) / 2, text.y, size, text.text) for text in below]
