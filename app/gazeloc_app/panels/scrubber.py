"""The slider and the number of the frame, as HTML of our own: the page moves both itself and does not wait for us.

viser's slider would be set back while it is dragged, by what the app was told a moment before. The page's half is
static/page/scrub.js.
"""

from __future__ import annotations

from viser import GuiApi

from gazeloc_app import widgets

_HTML = """<div class="gazeloc-scrub" title="Which frame of the recording shows, everywhere. Arrow keys step.">
  <label for="gazeloc-frame">Frame</label>
  <input id="gazeloc-frame" title="Drag to a frame." type="range" min="0" max="{last}" value="0"
    oninput="gazelocScrub.go(Number(this.value))" onpointerup="this.blur()">
  <input type="number" min="0" max="{last}" value="0" aria-label="Frame's number" oninput="this.dataset.typing = 1"
    onchange="gazelocScrub.typed(this)">
  <img alt="" src="data:," style="display:none" onerror="gazelocScrub.ready()">
</div>"""


class Scrubber:
    """Slider and number."""

    def __init__(self, gui: GuiApi):
        self._html = gui.add_html("")

    def show(self, last: int) -> None:
        """For a recording whose last frame is `last`."""
        widgets.set_content(self._html, _HTML.format(last=last))
