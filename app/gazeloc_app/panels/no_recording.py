"""Panel: what to do with a project that has a scan and no recording yet."""

from __future__ import annotations

import shlex
from pathlib import Path

from viser import GuiApi

from gazeloc_app import widgets
from gazeloc_app.state import AppState


class NoRecording:
    """A card with the command that adds one; look at the room meanwhile."""

    def __init__(self, gui: GuiApi, folder: Path):
        command = f"gazeloc add {shlex.quote(str(folder))} RECORDING"
        self._card = gui.add_html(
            widgets.box(
                '<div class="gazeloc-card"><p><b>No recording yet.</b></p>'
                "<p>Look around in the scan, measure it (“A click” above) and save views (tab Layers).</p>"
                "<p>To add what the glasses recorded, end GazeLoc, add its folder, and open the project again:</p>"
                f"<p><code>{widgets.text(command)}</code></p></div>"
            )
        )

    def render(self, state: AppState) -> None:
        """Nothing of it depends on the state."""
