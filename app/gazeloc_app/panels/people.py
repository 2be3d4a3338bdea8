"""Who is here, as one browser sees it: a dot and a name each, its own to be changed."""

from __future__ import annotations

from viser import GuiApi

from gazeloc_app import widgets
from gazeloc_app.actions.people import MAX_NAME
from gazeloc_app.state import AppState, Person

COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#b8860b", "#56b4e9")
"""By a person's number; after Okabe and Ito, told apart by colour-blind eyes."""


class PeopleBar:
    """One line at the top of one browser's panel."""

    def __init__(self, gui: GuiApi, client_id: int):
        self._client_id = client_id
        self._html = gui.add_html("", order=-1.0)
        self._seen: object = None

    def render(self, state: AppState) -> None:
        """Show the state's people."""
        if state.people == self._seen:  # typing a name must not be disturbed
            return
        self._seen = state.people
        own = [person for person in state.people if person.client_id == self._client_id]
        others = [person for person in state.people if person.client_id != self._client_id]
        parts = [*(_own_html(person) for person in own), *(_other_html(person) for person in others)]
        widgets.set_content(self._html, widgets.box(f'<div class="gazeloc-people">{"".join(parts)}</div>'))


def _dot(person: Person) -> str:
    return f'<i style="background:{COLORS[(person.number - 1) % len(COLORS)]}"></i>'


def _own_html(person: Person) -> str:
    return (
        f'<label title="You; the name that others see">{_dot(person)}<input aria-label="Your name" '
        f'maxlength="{MAX_NAME}" placeholder="{widgets.text(person.title)} (you)" value="{widgets.text(person.name)}" '
        'onchange="gazeloc.rename(this.value)"></label>'
    )


def _other_html(person: Person) -> str:
    return f'<span title="Has this project open too">{_dot(person)}{widgets.text(person.title)}</span>'
