"""Progress and tables on a terminal."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from tqdm import tqdm

from gazeloc_core.progress import Report


@contextmanager
def progress_bar() -> Iterator[Report]:
    """A bar on standard error where that is a terminal; elsewhere a line whenever the text's first part changes."""
    if sys.stderr.isatty():
        with tqdm(total=1.0, bar_format="{percentage:3.0f}% |{bar:30}| {elapsed} {desc}", leave=False) as bar:

            def show(fraction: float, text: str = "", /) -> None:
                bar.n = min(max(fraction, 0.0), 1.0)
                bar.set_description_str(text[:70])

            yield show
        return
    last = [""]

    def say(fraction: float, text: str = "", /) -> None:
        head = text.split(":")[0]
        if head != last[0]:
            last[0] = head
            print(f"{fraction:4.0%} {head}", file=sys.stderr, flush=True)

    yield say


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table of text with aligned columns."""
    cells = [list(head), *[list(row) for row in rows]]
    widths = [max(len(str(row[i])) for row in cells) for i in range(len(head))]
    lines = [
        "  ".join(str(cell).ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in cells
    ]
    return "\n".join([lines[0], "-" * min(sum(widths) + 2 * len(widths), 120), *lines[1:]])
