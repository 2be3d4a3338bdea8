"""Pages of black rectangles and text as a PDF file (ISO 32000-1): exact in size, however a printer samples them.

Lengths are metres from the page's upper left corner, y down. The file asks viewers not to scale when they print.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gazeloc_core.arrays import Floats, frozen

OURS = "%PDF-1.4\n%GazeLoc\n"
"""How our files begin, by which they are known."""
POINTS_PER_M = 72 / 0.0254
COURIER_ADVANCE = 0.6
"""Width of every letter of Courier, as a share of the font's size."""


@dataclass(frozen=True)
class PageText:
    """A line of ASCII text in Courier whose baseline begins at (`x`, `y`), `height` being the font's size."""

    x: float
    y: float
    height: float
    text: str

    @property
    def width(self) -> float:
        """Length of the line in metres."""
        return len(self.text) * COURIER_ADVANCE * self.height


@dataclass(frozen=True, eq=False)
class PdfPage:
    """One page: its size, black `rectangles` (R, 4) as x, y of the upper left corner, width, height; and texts."""

    width: float
    height: float
    rectangles: Floats
    texts: tuple[PageText, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "rectangles", frozen(np.reshape(self.rectangles, (-1, 4))))


def pdf_of(pages: Sequence[PdfPage], title: str) -> bytes:
    """The PDF file; the same pages give the same bytes."""
    first = 5
    kids = " ".join(f"{first + 2 * i} 0 R" for i in range(len(pages)))
    objects = [
        "<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>",
        f"<< /Type /Pages /Kids [{kids}] /Count {len(pages)} >>",
        "<< /Type /Font /Subtype /Type1 /BaseFont /Courier /Encoding /WinAnsiEncoding >>",
        f"<< /Title ({_escaped(title)}) /Producer (GazeLoc) >>",
    ]
    for i, page in enumerate(pages):
        content = _content(page)
        box = f"[0 0 {_points(page.width)} {_points(page.height)}]"
        objects.append(
            f"<< /Type /Page /Parent 2 0 R /MediaBox {box} /Resources << /Font << /F1 3 0 R >> >> "
            f"/Contents {first + 2 * i + 1} 0 R >>"
        )
        objects.append(f"<< /Length {len(content)} >>\nstream\n{content}endstream")
    return _file(objects)


def _content(page: PdfPage) -> str:
    """The page's drawing operators. All rectangles are one path, so that no seam shows between neighbours."""
    rows = [
        f"{_points(x)} {_points(page.height - y - h)} {_points(w)} {_points(h)} re"
        for x, y, w, h in page.rectangles.tolist()
    ]
    texts = [
        f"BT /F1 {_points(t.height)} Tf {_points(t.x)} {_points(page.height - t.y)} Td ({_escaped(t.text)}) Tj ET"
        for t in page.texts
    ]
    return "\n".join(["0 g", *rows, "f", *texts]) + "\n"


def _file(objects: Sequence[str]) -> bytes:
    """Header, numbered objects, cross-reference table and trailer."""
    content = OURS.encode("ascii")
    places = []
    for number, value in enumerate(objects, start=1):
        places.append(len(content))
        content += f"{number} 0 obj\n{value}\nendobj\n".encode("ascii")
    table = "".join(f"{place:010d} 00000 n \n" for place in places)
    size = len(objects) + 1
    end = f"xref\n0 {size}\n0000000000 65535 f \n{table}trailer\n<< /Size {size} /Root 1 0 R /Info 4 0 R >>\n"
    return content + f"{end}startxref\n{len(content)}\n%%EOF\n".encode("ascii")


def _points(metres: float) -> str:
    return f"{metres * POINTS_PER_M:.4f}"


def _escaped(text: str) -> str:
    return text.replace("\\", r"\\").replace("(", r"\(").replace(")", r"\)")
