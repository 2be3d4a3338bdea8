"""Who is here, shown to each page: in its panel with the tool that they hold, and in its scene where they look from.

Cameras and tools belong to browsers and not to the state. So a thread looks at them a few times a second, and only
while there is somebody to show.
"""

from __future__ import annotations

import logging
import math
import threading
from collections.abc import Callable, Sequence

from gazeloc_app.panels.people import color_of
from gazeloc_app.people.visit import Visit
from gazeloc_app.scene.people import Onlooker
from gazeloc_app.state import AppState, Layer, Person

log = logging.getLogger(__name__)
EVERY_S = 0.2
MAX_DRAWN = 12
"""So many others are drawn in a page's scene; all are in its panel."""
NEAR_M = 0.3
"""Somebody who stands where the page itself does would be drawn around its own eye."""


class Presence:
    """Shows the people of the state to all pages; safe to use from several threads."""

    def __init__(self, visits: Callable[[], Sequence[Visit]]):
        self._visits = visits
        self._state: AppState | None = None
        self._lock = threading.Lock()
        self._changed, self._ended = threading.Event(), threading.Event()

    def start(self) -> None:
        """Follow cameras and tools on a thread of its own, until `stop()`."""
        threading.Thread(target=self._run, name="gazeloc-people", daemon=True).start()

    def stop(self) -> None:
        """End the thread."""
        self._ended.set()
        self._changed.set()

    def render(self, state: AppState) -> None:
        """Show a state's people."""
        self._state = state
        self.show()
        self._changed.set()

    def show(self) -> None:
        """Show where people look from and what they hold now."""
        with self._lock:
            state, visits = self._state, self._visits()
            if state is None:
                return
            by_client = {visit.client.client_id: visit for visit in visits}
            tools = {number: visit.browser.tool.name for number, visit in by_client.items()}
            cameras = _onlookers(state.people, by_client) if state.layers.is_visible(Layer.PEOPLE) else {}
            for client_id, visit in by_client.items():
                visit.people.render(state.people, tools)
                visit.onlookers.show(_seen_from(client_id, cameras))

    def _run(self) -> None:
        while not self._ended.wait(EVERY_S):
            if len(self._visits()) < 2:  # nobody to show
                self._changed.wait()
                self._changed.clear()
            try:
                self.show()
            except Exception:  # the next look must come, whatever a page that is just going does to this one
                log.exception("showing people")


def _onlookers(people: Sequence[Person], visits: dict[int, Visit]) -> dict[int, Onlooker]:
    """Everybody's camera by client, of those whose page has said where it is."""
    found = {}
    for person in people:
        visit = visits.get(person.client_id)
        view = visit.view if visit is not None else None
        if visit is None or view is None:
            continue
        camera = visit.client.camera
        wxyz = tuple(float(part) for part in camera.wxyz)
        aspect = float(camera.image_width) / max(float(camera.image_height), 1.0)
        if len(wxyz) == 4 and all(map(math.isfinite, (*wxyz, aspect))) and any(wxyz):
            w, x, y, z = wxyz
            found[person.client_id] = Onlooker(
                person.number, person.title, color_of(person), view.position, (w, x, y, z), view.fov_rad, aspect
            )
    return found


def _seen_from(client_id: int, cameras: dict[int, Onlooker]) -> list[Onlooker]:
    own = cameras.get(client_id)
    others = [one for number, one in cameras.items() if number != client_id]
    if own is not None:
        others = [one for one in others if math.dist(one.position, own.position) > NEAR_M]
    return others[:MAX_DRAWN]
