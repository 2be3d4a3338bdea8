"""Views that people keep: places to look at the room from."""

from __future__ import annotations

from dataclasses import dataclass, replace

from gazeloc_app.state import AppState, Level
from gazeloc_core.surfaces.saved_views import MAX_VIEWS, SavedView


@dataclass(frozen=True)
class SaveView:
    """A view was saved; one of the same name is replaced."""

    view: SavedView

    def apply(self, state: AppState) -> AppState:
        """The state with it, the newest last."""
        others = _without(state, self.view.name)
        if len(others) >= MAX_VIEWS:
            return state.noticed(Level.WARNING, f"There are {MAX_VIEWS} views already; remove one first.")
        return _with(state, (*others, self.view))


@dataclass(frozen=True)
class RenameView:
    """A view got another name."""

    name: str
    new_name: str

    def apply(self, state: AppState) -> AppState:
        """The state with it, in its place; refused where another view has that name."""
        if self.name != self.new_name and any(view.name == self.new_name for view in state.annotation.views):
            return state.noticed(Level.WARNING, f"There is a view “{self.new_name}” already; take another name.")
        views = state.annotation.views
        renamed = (replace(view, name=self.new_name) if view.name == self.name else view for view in views)
        return _with(state, tuple(renamed))


@dataclass(frozen=True)
class RemoveView:
    """A view was removed."""

    name: str

    def apply(self, state: AppState) -> AppState:
        """The state without it."""
        return _with(state, _without(state, self.name))


def _without(state: AppState, name: str) -> tuple[SavedView, ...]:
    return tuple(view for view in state.annotation.views if view.name != name)


def _with(state: AppState, views: tuple[SavedView, ...]) -> AppState:
    return state.annotate(replace(state.annotation, views=views))
