"""Who is here, as one browser sees it: a dot and a name each, its own to be changed, others' to go to what they see."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from viser import GuiApi

from gazeloc_app import widgets
from gazeloc_app.actions.people import MAX_NAME
from gazeloc_app.palette import PEOPLE, Rgb
from gazeloc_app.state import Person

MAX_SHOWN = 12


def color_of(person: Person) -> Rgb:
    """A person's colour, in panels and in the scene."""
    return PEOPLE[(person.number - 1) % len(PEOPLE)]


class PeopleBar:
    """Two lines at the top of one browser's panel: oneself, and the others."""

    def __init__(self, gui: GuiApi, client_id: int):
        self._client_id = client_id
        self._own = gui.add_html("", order=-2.0)
        self._others = gui.add_html("", order=-1.0, visible=False)

    def render(self, people: Sequence[Person], tools: Mapping[int, str]) -> None:
        """Show the people; `tools` are the names of what they hold, by client."""
        own = "".join(_own_html(person) for person in people if person.client_id == self._client_id)
        others = [person for person in people if person.client_id != self._client_id]
        shown = [_other_html(person, tools.get(person.client_id, "")) for person in others[:MAX_SHOWN]]
        if len(others) > MAX_SHOWN:
            shown.append(f"<span>and {len(others) - MAX_SHOWN} more</span>")
        widgets.set_content(self._own, _line(own))  # apart, so that typing a name is not disturbed by the others
        widgets.set_content(self._others, _line("".join(shown)))
        widgets.set_property(self._others, "visible", bool(others))


def _line(content: str) -> str:
    return widgets.box(f'<div class="gazeloc-people">{content}</div>')


def _dot(person: Person) -> str:
    return '<i style="background:rgb({},{},{})"></i>'.format(*color_of(person))


def _own_html(person: Person) -> str:
    return (
        f'<label title="You; the name that others see">{_dot(person)}<input aria-label="Your name" '
        f'maxlength="{MAX_NAME}" placeholder="{widgets.text(person.title)}" value="{widgets.text(person.name)}" '
        'onchange="gazeloc.rename(this.value)"></label><small>you</small>'
    )


def _other_html(person: Person, tool: str) -> str:
    title, holds = widgets.text(person.title), f"<small>{widgets.text(tool)}</small>" if tool else ""
    return (
        f'<button type="button" class="gazeloc-person" title="Go to what {title} sees" '
        f"onclick=\"gazeloc.ask('go-to-person',{{number:{person.number}}})\">{_dot(person)}{title} {holds}</button>"
    )
