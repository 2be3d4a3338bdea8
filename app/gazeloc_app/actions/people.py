"""Who is here: pages that came, were named, and left."""

from __future__ import annotations

from dataclasses import dataclass, replace

from gazeloc_app.state import AppState, Person

MAX_NAME = 30


@dataclass(frozen=True)
class PersonCame:
    """A page was opened, in the connection `client_id`; without a name it is called by the lowest free number."""

    client_id: int
    name: str = ""

    def apply(self, state: AppState) -> AppState:
        """The state with the person."""
        others = tuple(person for person in state.people if person.client_id != self.client_id)
        known = next((person for person in state.people if person.client_id == self.client_id), None)
        taken = {person.number for person in others}
        free = next(number for number in range(1, len(taken) + 2) if number not in taken)
        person = Person(self.client_id, known.number if known else free, tidy(self.name))
        return replace(state, people=tuple(sorted((*others, person), key=lambda one: one.number)))


@dataclass(frozen=True)
class PersonLeft:
    """A page was closed, or its connection was lost."""

    client_id: int

    def apply(self, state: AppState) -> AppState:
        """The state without the person."""
        return replace(state, people=tuple(one for one in state.people if one.client_id != self.client_id))


def tidy(name: str) -> str:
    """A name as it is kept: one line, not too long."""
    return " ".join(name.split())[:MAX_NAME]
