"""The arrow keys of one browser as commands: they nudge the selected keypoint (see keypoints/hand.py for what of it).

The page takes the keys itself while a keypoint is selected (static/page/arrows.js), else viser would turn the view with
them; the commands are in the palette and name the keys in the help.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from viser import GuiApi

from gazeloc_app import widgets
from gazeloc_app.keypoints.moving import ARROWS, Nudge, nudge_of

NAMES = {"arrowleft": "left", "arrowright": "right", "arrowup": "up", "arrowdown": "down"}
LENGTHS = {False: "2 mm, in frames by a pixel", True: "1 cm, in frames by a tenth of a pixel"}


def add_nudges(gui: GuiApi, nudge: Callable[[Nudge], None]) -> None:
    """Call `nudge(step)` for every arrow, with the shift key and without; not while typing into a field."""
    for is_shifted, length in LENGTHS.items():
        modifier: Any = "shift" if is_shifted else None
        for key in ARROWS:
            hotkey: Any = key
            command = gui.add_command(f"Nudge {NAMES[key]} by {length}", hotkey=hotkey, modifier=modifier)
            widgets.on_user(command, _nudging(nudge, nudge_of(key, is_shifted=is_shifted)), event="on_trigger")


def _nudging(nudge: Callable[[Nudge], None], step: Nudge) -> Callable[[Any], None]:
    return lambda _: nudge(step)
