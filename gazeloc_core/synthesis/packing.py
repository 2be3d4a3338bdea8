"""Rectangles on shelves: where each texture lies in an atlas."""

from __future__ import annotations

from collections.abc import Sequence


def packed(sizes: Sequence[tuple[int, int]], width: int, margin: int) -> tuple[list[tuple[int, int]], int]:
    """Upper left corners of rectangles (w, h) in an atlas of `width`, `margin` around each, and the atlas's height.

    The tallest come first, so shelves waste little; the order of equals is that of the list.
    """
    corners = [(0, 0)] * len(sizes)
    x, y, shelf = 0, 0, 0
    for index in sorted(range(len(sizes)), key=lambda i: (-sizes[i][1], i)):
        w, h = sizes[index]
        if x + w + 2 * margin > width:
            x, y, shelf = 0, y + shelf, 0
        corners[index] = (x + margin, y + margin)
        x, shelf = x + w + 2 * margin, max(shelf, h + 2 * margin)
    return corners, y + shelf
