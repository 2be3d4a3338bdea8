"""Small helpers that every panel uses: callbacks that only users trigger, and HTML that cannot be injected."""

from __future__ import annotations

import html
from collections.abc import Callable, Sequence
from typing import Any

from gazeloc_app import palette
from gazeloc_core.frames.marks import Mark

GOOD, WARNING, BAD, MUTED = (palette.meaning(name) for name in palette.TEXT_MEANINGS)
MARK_COLORS = {Mark.GOOD: GOOD, Mark.BAD: BAD, Mark.UNSURE: WARNING}
LEVEL_COLORS = {"good": GOOD, "info": MUTED, "warning": WARNING, "bad": BAD, "error": BAD}


def on_user(handle: Any, react: Callable[[Any], None], *, event: str = "on_update") -> None:
    """Call `react(event)` when a browser changes the widget, in order; our own assignments are ignored."""

    async def callback(happened: Any) -> None:
        if happened.client_id is not None:
            react(happened)

    getattr(handle, event)(callback)


def set_value(handle: Any, value: Any) -> None:
    """Assign a widget's value where it differs, so that nothing is sent for nothing."""
    if handle.value != value:
        handle.value = value


def set_content(handle: Any, content: str) -> None:
    """Replace HTML or markdown where it differs."""
    if handle.content != content:
        handle.content = content


def set_property(handle: Any, name: str, value: Any) -> None:
    """Assign any other property of a widget where it differs."""
    if getattr(handle, name) != value:
        setattr(handle, name, value)


def text(value: object) -> str:
    """Text as HTML: what users named can hold anything."""
    return html.escape(str(value), quote=True)


def colored(value: object, color: str) -> str:
    """Text in a colour."""
    return f'<span style="color:{color}">{text(value)}</span>'


def box(content: str) -> str:
    """HTML in the panel's type and padding."""
    return f'<div class="gazeloc-box">{content}</div>'


def card(head: str, sentence: str) -> str:
    """What to do first where there is nothing to show yet; both are text."""
    return f'<div class="gazeloc-card"><p><b>{text(head)}</b></p>{text(sentence)}</div>'


def html_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table; cells are HTML already, heads are text."""
    lines = ["".join(f"<th>{text(name)}</th>" for name in head)] if any(head) else []
    lines += ["".join(f"<td>{value}</td>" for value in row) for row in rows]
    body = "".join(f"<tr>{line}</tr>" for line in lines)
    return f"<table>{body}</table>"


def centimetres(value_m: float | None) -> str:
    """Metres as centimetres for people, a dash for none."""
    return "–" if value_m is None else f"{100 * value_m:.1f} cm"
