"""Which values of a widget a browser may send: those that the widget itself offers. Everything else is made up."""

from __future__ import annotations

import math
from typing import Any

MAX_TEXT = 4096


def is_offered(handle: Any, value: object) -> bool:
    """Whether a widget in its present state can be brought to `value` by hand. Widgets without a rule take nothing."""
    if not _is_at_hand(handle):
        return False
    options = getattr(handle, "options", None)
    if options is not None:
        return isinstance(value, str) and value in options
    present, low, high = handle.value, getattr(handle, "min", None), getattr(handle, "max", None)
    if isinstance(present, bool):
        return isinstance(value, bool)
    if isinstance(present, int | float):
        return _is_between(value, low, high)
    if isinstance(present, str):
        return isinstance(value, str) and len(value) <= MAX_TEXT
    if isinstance(present, tuple) and isinstance(value, list | tuple) and len(value) == len(present):
        lows, highs = _each(low, len(present)), _each(high, len(present))
        if type(handle).__name__ in ("GuiRgbHandle", "GuiRgbaHandle"):
            lows, highs = (0,) * len(present), (255,) * len(present)
        return all(_is_between(*part) for part in zip(value, lows, highs, strict=True))
    return False


def takes_files(handle: Any) -> bool:
    """Whether a widget is a button for uploads that can be pressed."""
    return type(handle).__name__ == "GuiUploadButtonHandle" and _is_at_hand(handle)


def _is_at_hand(handle: Any) -> bool:
    return not getattr(handle, "disabled", False) and getattr(handle, "visible", True)


def _each(bound: Any, count: int) -> tuple[Any, ...]:
    return tuple(bound) if isinstance(bound, tuple | list) else (bound,) * count


def _is_between(value: object, low: float | None, high: float | None) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return False
    return (low is None or value >= low) and (high is None or value <= high)
