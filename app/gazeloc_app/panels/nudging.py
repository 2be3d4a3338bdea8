"""The arrow keys of one browser: they nudge the selected keypoint (see hand.py for what of it)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from viser import GuiApi

from gazeloc_app import widgets
from gazeloc_app.moving import ARROWS, FINE_STEP_PX, LONG_STEP_M, STEP_M, STEP_PX, Nudge

NAMES = {"arrowleft": "left", "arrowright": "right", "arrowup": "up", "arrowdown": "down"}


def add_nudges(gui: GuiApi, nudge: Callable[[Nudge], None]) -> None:
    """Call `nudge(step)` for every arrow: 2 mm or a pixel, with the shift key 1 cm or a tenth; not while typing."""
    steps: tuple[tuple[Any, float, float, str], ...] = (
        (None, STEP_M, STEP_PX, "2 mm, in frames by a pixel"),
        ("shift", LONG_STEP_M, FINE_STEP_PX, "1 cm, in frames by a tenth of a pixel"),
    )
    for modifier, step_m, step_px, length in steps:
        for key, screen in ARROWS.items():
            hotkey: Any = key
            command = gui.add_command(f"Nudge {NAMES[key]} by {length}", hotkey=hotkey, modifier=modifier)
            widgets.on_user(command, _nudging(nudge, Nudge(screen, step_m, step_px)), event="on_trigger")


def _nudging(nudge: Callable[[Nudge], None], step: Nudge) -> Callable[[Any], None]:
    return lambda _: nudge(step)
