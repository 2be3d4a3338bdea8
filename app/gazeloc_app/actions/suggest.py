"""Suggestions of the next place to click."""

from __future__ import annotations

from dataclasses import dataclass

from gazeloc_app.state import AppState


@dataclass(frozen=True)
class ShowSuggestions:
    """The next best place shall be shown, or not."""

    is_on: bool

    def apply(self, state: AppState) -> AppState:
        """The state with it."""
        return state.with_layers(suggests=self.is_on)
