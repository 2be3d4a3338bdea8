"""Views that people keep: places to look at the room from."""

from __future__ import annotations

from dataclasses import dataclass, replace

from gazeloc_app.state import AppState, Level
from gazeloc_core.saved_views import MAX_VIEWS, SavedView


@dataclass(frozen=True)
class SaveView:
    """A view was saved; one of the same name is replaced."""

    view: SavedView

    def apply(self, state: AppState) -> AppState:
        """The state with it, the newest last."""
        others = tuple(view for view in state.views if view.name != self.view.name)
        if len(others) >= MAX_VIEWS:
            return state.noticed(Level.WARNING, f"There are {MAX_VIEWS} views already; remove one first.")
        return replace(state, views=(*others, self.view))


@dataclass(frozen=True)
class RemoveView:
    """A view was removed."""

    name: str

    def apply(self, state: AppState) -> AppState:
        """The state without it."""
        return replace(state, views=tuple(view for view in state.views if view.name != self.name))
