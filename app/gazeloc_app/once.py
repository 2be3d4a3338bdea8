"""Doing a thing again only when what it depends on has changed."""

from __future__ import annotations

from collections.abc import Callable


class Once:
    """Remembers by name what was drawn: `once("cloud", points, draw)` draws only where `points` differ from before."""

    def __init__(self) -> None:
        self._shown: dict[str, object] = {}

    def __call__(self, name: str, shown: object, draw: Callable[[], object]) -> None:
        """Call `draw` where `shown` is not equal to what it was for this name the last time, or there was none."""
        if name not in self._shown or self._shown[name] != shown:
            self._shown[name] = shown
            draw()
