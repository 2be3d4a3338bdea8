"""The arrow keys of one browser: they nudge the selected keypoint along the scan's surface."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from viser import GuiApi

from gazeloc_app import widgets
from gazeloc_app.moving import ARROWS, LONG_STEP_M, STEP_M

NAMES = {"arrowleft": "left", "arrowright": "right", "arrowup": "up", "arrowdown": "down"}


def add_nudges(gui: GuiApi, nudge: Callable[[tuple[int, int], float], None]) -> None:
    """Call `nudge(screen, step_m)` for every arrow: 2 mm, with the shift key 1 cm. Not while typing into a field."""
    steps: tuple[tuple[Any, float, str], ...] = ((None, STEP_M, "2 mm"), ("shift", LONG_STEP_M, "1 cm"))
    for modifier, step_m, length in steps:
        for key, screen in ARROWS.items():
            hotkey: Any = key
            command = gui.add_command(f"Nudge {NAMES[key]} by {length}", hotkey=hotkey, modifier=modifier)
            widgets.on_user(command, _nudging(nudge, screen, step_m), event="on_trigger")


def _nudging(
    nudge: Callable[[tuple[int, int], float], None], screen: tuple[int, int], step_m: float
) -> Callable[[Any], None]:
    return lambda _: nudge(screen, step_m)
