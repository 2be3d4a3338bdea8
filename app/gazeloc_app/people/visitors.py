"""Pages by their tabs: who they are, what they ask for by URL, and the view that each comes back to.

viser gives every connection a new client and forgets the last. So the page keeps an id for its tab
(static/page/session.js), and each connection gets a secret that only its page is told. With it the page asks
`/session/<secret>/<what>`: no other page can know it, so these GETs may change things. All of it
runs on the event loop.
"""

from __future__ import annotations

import re
import secrets
import threading
from collections.abc import Callable, Mapping

import viser

from gazeloc_app.actions.action import Action
from gazeloc_app.actions.history import GoToStep
from gazeloc_app.actions.jobs import CancelJob
from gazeloc_app.actions.people import PersonCame, PersonLeft
from gazeloc_app.browser import Browser
from gazeloc_app.panels.people import PeopleBar
from gazeloc_app.people.presence import Presence
from gazeloc_app.people.view_memory import ViewMemory
from gazeloc_app.people.visit import Visit
from gazeloc_app.routes import Asked, Reply, Routes
from gazeloc_app.scene.people import PeopleLayer
from gazeloc_app.state import AppState, Person
from gazeloc_core.errors import InputError

_SAVE_EVERY_S = 1.0
_BROWSER_ID = re.compile(r"[a-z0-9]{16,40}")
_HELLO = (
    '<img alt="" src="data:," style="display:none" '
    "onerror=\"window.gazeloc&&window.gazeloc.hello('{secret}','{start}')\">"
)


class Visitors:
    """All connections of one app."""

    def __init__(self, memory: ViewMemory, dispatch: Callable[[Action], None]):
        self._memory, self._dispatch = memory, dispatch
        self._visits: dict[str, Visit] = {}
        self._start = secrets.token_hex(8)
        """Tells this run of the app from the one before, whose page may have other scripts."""
        self._people: tuple[Person, ...] = ()
        self._presence = Presence(lambda: list(self._visits.values()))
        self._ended = threading.Event()
        self._asks: dict[str, Callable[[Visit, Mapping[str, str]], None]] = {
            "hello": self._hello,
            "name": self._name,
            "go-to-person": self._go_to_person,
            "cancel-job": lambda _, query: self._dispatch(CancelJob(_number(query, "number"))),
            "arrow": lambda visit, query: visit.browser.hand.press_arrow(query),
            "frame-click": lambda visit, query: visit.browser.hand.click_in_frame(query),
            "loupe-click": lambda visit, query: visit.browser.hand.click_in_loupe(query),
            "go-to-step": lambda _, query: self._dispatch(GoToStep(_number(query, "step"), _number(query, "count"))),
        }

    def start(self) -> None:
        """Save the views now and then, and show where people look from, on threads of their own until `stop()`."""
        self._presence.start()
        threading.Thread(target=self._save_now_and_then, name="gazeloc-views", daemon=True).start()

    def stop(self) -> None:
        """End the threads and save the views."""
        self._presence.stop()
        self._ended.set()
        self.remember()

    def come(self, client: viser.ClientHandle, browser: Browser, state: AppState) -> None:
        """A page has connected."""
        secret = secrets.token_urlsafe(24)
        people, onlookers = PeopleBar(client.gui, client.client_id), PeopleLayer(client.scene)
        self._visits[secret] = Visit(client, browser, people, onlookers)
        people.render(state.people, {})
        self._dispatch(PersonCame(client.client_id))
        client.gui.add_html(_HELLO.format(secret=secret, start=self._start))

    def go(self, client: viser.ClientHandle) -> None:
        """A page has gone, or its connection was lost."""
        for secret, visit in list(self._visits.items()):
            if visit.client.client_id == client.client_id:
                self._remember(visit)
                del self._visits[secret]
        self._dispatch(PersonLeft(client.client_id))

    def render(self, state: AppState) -> None:
        """Show everybody who is here."""
        self._people = state.people
        self._presence.render(state)

    def remember(self) -> None:
        """Remember all views, on the disk too."""
        for visit in list(self._visits.values()):
            self._remember(visit)
        self._memory.save()

    def add_routes(self, routes: Routes) -> None:
        """`/session/<secret>/<what>?...`: what a page asks for; answers whether its connection is known."""

        async def answer(asked: Asked) -> Reply:
            visit = self._visits.get(asked.names["secret"])
            if visit is not None and asked.names["what"] != "here":
                if asked.names["what"] not in self._asks:
                    raise InputError(f"A page cannot ask for {asked.names['what']!r}.")
                self._asks[asked.names["what"]](visit, asked.query)
            body = b"here" if visit is not None else b"gone"
            return Reply(body=body, content_type="text/plain; charset=utf-8")

        routes.get("/session/{secret}/{what}", answer)

    def _hello(self, visit: Visit, query: Mapping[str, str]) -> None:
        tab = query.get("tab", "")
        if not _BROWSER_ID.fullmatch(tab):
            raise InputError("A page's id is letters and digits.")
        for other in self._visits.values():  # its last connection may not be known to be lost yet
            if other.tab == tab and other is not visit:
                self._remember(other)
                other.tab = None
        if visit.tab != tab:  # a page says hello again whenever its panels are built anew, and stays where it is
            visit.tab = tab
            view = self._memory.get(tab)
            if view is not None:
                visit.come_back(view)
        self._name(visit, query)

    def _name(self, visit: Visit, query: Mapping[str, str]) -> None:
        self._dispatch(PersonCame(visit.client.client_id, query.get("name", "")[:200]))

    def _go_to_person(self, visit: Visit, query: Mapping[str, str]) -> None:
        number = _number(query, "number")
        client_id = next((person.client_id for person in self._people if person.number == number), None)
        other = next((one for one in self._visits.values() if one.client.client_id == client_id), None)
        view = None if other is None else other.view
        if view is not None:  # they may just have gone
            visit.go_to(view)

    def _remember(self, visit: Visit) -> None:
        if visit.tab is not None:
            view = visit.view_to_keep()
            if view is not None:
                self._memory.put(visit.tab, view)

    def _save_now_and_then(self) -> None:
        while not self._ended.wait(_SAVE_EVERY_S):
            self.remember()


def _number(query: Mapping[str, str], name: str) -> int:
    value = query.get(name, "")
    if not re.fullmatch(r"[0-9]{1,9}", value):
        raise InputError(f"{name}={value[:40]!r} is not a number.")
    return int(value)
