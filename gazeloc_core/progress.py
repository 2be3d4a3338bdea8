"""How a long stage says how far it is, and how it is asked to stop."""

from __future__ import annotations

from typing import Protocol


class Report(Protocol):
    """A progress bar in the app, in the terminal, or nothing in tests.

    Calling it may raise `Cancelled`; a stage lets that pass and leaves no half-written artifact.
    """

    def __call__(self, fraction: float, text: str = "", /) -> None:
        """Show that `fraction` (0 to 1) of the work is done and what is done now."""


def silent(fraction: float, text: str = "", /) -> None:
    """The report that shows nothing and never cancels."""


def part(report: Report, start: float, end: float) -> Report:
    """The report for a part of the work that runs from `start` to `end` of the whole."""

    def report_part(fraction: float, text: str = "", /) -> None:
        report(start + (end - start) * fraction, text)

    return report_part
