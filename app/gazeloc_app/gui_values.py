"""Which values of a widget a browser may send: those that the widget itself offers. Everything else is made up."""

from __future__ import annotations

import math
from typing import Any

MAX_TEXT = 4096


def is_offered(handle: Any, value: object) -> bool:
    """Whether a widget in its present state can be brought to `value` by hand. Widgets without a rule take anything."""
    if getattr(handle, "disabled", False):
        return False
    options = getattr(handle, "options", None)
    if options is not None:
        return value in options
    present = handle.value
    if isinstance(present, bool):
        return isinstance(value, bool)
    if isinstance(present, int | float):
        return _is_between(value, getattr(handle, "min", None), getattr(handle, "max", None))
    if isinstance(present, str):
        return isinstance(value, str) and len(value) <= MAX_TEXT
    if isinstance(present, tuple) and isinstance(value, list | tuple):
        return len(value) == len(present) and all(_is_between(part, None, None) for part in value)
    return True


def _is_between(value: object, low: float | None, high: float | None) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return False
    return (low is None or value >= low) and (high is None or value <= high)
