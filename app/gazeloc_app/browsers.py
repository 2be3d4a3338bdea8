"""All pages that are connected, each with what belongs to it alone."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import viser

from gazeloc_app.browser import Browser
from gazeloc_app.looks import Look
from gazeloc_app.scene.kept import EVERYTHING, Kept
from gazeloc_app.state import AppState


class Browsers(Mapping[int, Browser]):
    """The browsers by client. Pages come and go on viser's event loop; anybody may look."""

    def __init__(self, make: Callable[[viser.ClientHandle], Browser], make_look: Callable[[viser.ClientHandle], Look]):
        self._make, self._make_look = make, make_look
        self._browsers: dict[int, Browser] = {}
        self._looks: dict[int, Look] = {}

    def __getitem__(self, client_id: int) -> Browser:
        return self._browsers[client_id]

    def __iter__(self) -> Iterator[int]:
        return iter(list(self._browsers))

    def __len__(self) -> int:
        return len(self._browsers)

    def come(self, client: viser.ClientHandle) -> Browser:
        """A page has connected; it takes on the look that it had the last time."""
        browser = self._browsers[client.client_id] = self._make(client)
        look = self._looks[client.client_id] = self._make_look(client)
        look.remember()
        return browser

    def go(self, client: viser.ClientHandle) -> None:
        """A page has gone, or its connection was lost."""
        self._browsers.pop(client.client_id, None)
        self._looks.pop(client.client_id, None)

    def render(self, state: AppState) -> None:
        """Let every page follow the state."""
        for browser in list(self._browsers.values()):
            browser.render(state)

    def toggle_look(self, client_id: int) -> None:
        """Change one page between light and dark."""
        look = self._looks.get(client_id)
        if look is not None:
            look.toggle()

    def kept(self, client_id: int) -> Kept:
        """What one page's cuts leave of the room."""
        browser = self._browsers.get(client_id)
        return EVERYTHING if browser is None else browser.kept
