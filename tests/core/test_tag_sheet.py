"""The printed sheet, read back from the PDF's own operators: true sizes, and tags that the detector finds."""

import re

import cv2
import numpy as np
import pytest

from gazeloc_core.errors import InputError
from gazeloc_core.tags.bitmaps import tag_bitmap
from gazeloc_core.tags.detection import FAMILIES, TagDetector, TagOptions
from gazeloc_core.tags.sheet import PAPERS_M, SheetOptions, parse_ids, sheet_pdf, size_note

MM_PER_POINT = 25.4 / 72
PX_PER_MM = 4.0


def pages_of(pdf: bytes) -> list[tuple[np.ndarray, np.ndarray, list[str]]]:
    """Each page's size (2,), rectangles (R, 4) from the lower left, both in mm, and texts: this test's own reading."""
    text = pdf.decode("ascii")
    boxes = re.findall(r"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", text)
    streams = re.findall(r"stream\n(.*?)endstream", text, re.S)
    found = []
    for box, stream in zip(boxes, streams, strict=True):
        number = r"(-?[\d.]+)"
        rectangles = np.array(re.findall(rf"^{number} {number} {number} {number} re$", stream, re.M), dtype=float)
        texts = re.findall(r"\((.*)\) Tj", stream)
        found.append((np.array(box, dtype=float) * MM_PER_POINT, rectangles * MM_PER_POINT, texts))
    return found


def shares(start: np.ndarray, length: np.ndarray, count: int) -> np.ndarray:
    """(R, count) how much of each pixel of a line the intervals cover."""
    edges = np.arange(count + 1)
    reach = np.clip(edges[None], start[:, None], (start + length)[:, None])
    return np.diff(reach, axis=1)


def printed(size: np.ndarray, rectangles: np.ndarray) -> np.ndarray:
    """The page as paper: exact coverage of every pixel by ink, a little unsharp."""
    width, height = np.ceil(size * PX_PER_MM).astype(int)
    x, y, w, h = (rectangles * PX_PER_MM).T
    ink = shares(size[1] * PX_PER_MM - y - h, h, height).T @ shares(x, w, width)
    return cv2.GaussianBlur((215 - 190 * np.clip(ink, 0, 1)), (0, 0), 0.6).astype(np.uint8)


@pytest.mark.parametrize("family", FAMILIES)
def test_the_detector_finds_the_printed_tags_at_their_true_size(family: str) -> None:
    options = SheetOptions(ids=(0, 3, 17, 29), size_m=0.03, family=family)
    with TagDetector(TagOptions(family=family)) as detector:
        found = [detector.detect(printed(size, drawn)) for size, drawn, _ in pages_of(sheet_pdf(options))]
    assert np.concatenate([sightings.tag_id for sightings in found]).tolist() == [0, 3, 17, 29]
    corners = np.concatenate([sightings.corners_px for sightings in found]) / PX_PER_MM
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    np.testing.assert_allclose(sides, 30.0, atol=0.15)  # half a pixel; a scale fault of a cell would be 4 mm
    upright = corners[:, 1] - corners[:, 0]
    assert (upright[:, 0] > 29).all()
    assert (np.abs(upright[:, 1]) < 0.2).all()


@pytest.mark.parametrize("paper", PAPERS_M)
def test_pages_have_the_papers_size_and_all_ink_is_printable(paper: str) -> None:
    pages = pages_of(sheet_pdf(SheetOptions(ids=tuple(range(30)), size_m=0.08, paper=paper)))
    for size, rectangles, _ in pages:
        np.testing.assert_allclose(size, np.array(PAPERS_M[paper]) * 1000, atol=1e-3)
        assert (rectangles[:, :2] > 4.8).all()
        assert (rectangles[:, :2] + rectangles[:, 2:] < size - 4.8).all()
    labels = [text for _, _, texts in pages for text in texts if " id " in text]
    assert labels == [f"tag36h11  id {i}  80 mm" for i in range(30)]


def test_the_ruler_is_ten_centimetres() -> None:
    _, rectangles, texts = pages_of(sheet_pdf(SheetOptions(ids=(0,), size_m=0.16)))[0]
    lines = rectangles[rectangles[:, 3] < 0.3]
    np.testing.assert_allclose(lines[:, 2].max(), 100.0, atol=1e-3)
    assert any("100 mm" in text for text in texts)
    assert any("--tag-family tag36h11 --tag-size 0.16" in text for text in texts)


def test_margins_stay_white_but_for_thin_lines() -> None:
    """One cell of white around the black square: there, ink is thinner than a quarter of a millimetre."""
    _, rectangles, _ = pages_of(sheet_pdf(SheetOptions(ids=(5,), size_m=0.16)))[0]
    thick = rectangles[rectangles[:, 2:].min(axis=1) > 0.25]
    x, y = thick[:, 0].min(), thick[:, 1].min()
    right, top = (thick[:, :2] + thick[:, 2:]).max(axis=0)
    np.testing.assert_allclose([right - x, top - y], 160.0, atol=1e-3)
    np.testing.assert_allclose([x, 210 - right, 297 - top], [25, 25, 25], atol=1e-3)  # 20 of margin, 5 unprintable


def test_a_pdf_reader_finds_every_object() -> None:
    """The cross-reference table points at the objects that it names."""
    pdf = sheet_pdf(SheetOptions(ids=(0, 1, 2), size_m=0.16))
    start = int(re.search(rb"startxref\n(\d+)\n%%EOF\n$", pdf)[1])
    assert pdf[start : start + 4] == b"xref"
    places = [int(place) for place in re.findall(rb"(\d{10}) 00000 n ", pdf)]
    assert all(pdf[place:].startswith(f"{i} 0 obj\n".encode()) for i, place in enumerate(places, start=1))
    lengths = [int(length) for length in re.findall(rb"/Length (\d+)", pdf)]
    assert [len(stream) for stream in re.findall(rb"stream\n(.*?)endstream", pdf, re.S)] == lengths
    assert b"/PrintScaling /None" in pdf


def test_bitmaps_are_those_of_opencv() -> None:
    """An independent table of the codes, for the families that OpenCV has; it draws them turned by half."""
    for family, name in (
        ("tag36h11", cv2.aruco.DICT_APRILTAG_36h11),
        ("tag25h9", cv2.aruco.DICT_APRILTAG_25h9),
        ("tag16h5", cv2.aruco.DICT_APRILTAG_16h5),
    ):
        dictionary = cv2.aruco.getPredefinedDictionary(name)
        for tag_id in (0, 7, 29):
            bitmap = tag_bitmap(family, tag_id)
            theirs = cv2.aruco.generateImageMarker(dictionary, tag_id, bitmap.across) > 0
            np.testing.assert_array_equal(np.rot90(theirs, 2), bitmap.is_white[1:-1, 1:-1])


def test_the_note_names_the_edge_that_counts() -> None:
    assert "outer edge" in size_note("tag36h11", 0.16)
    assert "inner edge" in size_note("tagStandard41h12", 0.16)
    assert "inner edge" in size_note("tagCircle21h7", 0.16)


def test_ids_are_read_in_their_order_once_each() -> None:
    assert parse_ids("0-3, 9,2,7-8") == (0, 1, 2, 3, 9, 7, 8)


@pytest.mark.parametrize("text", ["", "a", "1-", "-1", "5-3", "1,,2", "1.5", "0-5000", "0-9999999"])
def test_ids_that_cannot_be_read_are_refused(text: str) -> None:
    with pytest.raises(InputError, match=re.escape(repr(text))):
        parse_ids(text)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (SheetOptions(ids=(0,), size_m=0.16, family="tag36h10"), "tag36h10"),
        (SheetOptions(ids=(35,), size_m=0.16, family="tag25h9"), "0 to 34"),
        (SheetOptions(ids=(), size_m=0.16), "at least one"),
        (SheetOptions(ids=(0,), size_m=0.16, paper="a9"), "a9"),
        (SheetOptions(ids=(0,), size_m=0.165), "0.16 m at most"),
        (SheetOptions(ids=(0,), size_m=0.0), "0.005 and 5"),
        (SheetOptions(ids=(0,), size_m=float("nan")), "0.005 and 5"),
    ],
)
def test_impossible_sheets_are_refused(options: SheetOptions, words: str) -> None:
    with pytest.raises(InputError, match=words):
        sheet_pdf(options)
