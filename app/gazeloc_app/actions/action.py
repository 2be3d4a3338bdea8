"""An action: one thing that happened, as a value; `apply(state)` is pure and gives the next state.

Callbacks of the viewer make actions and enqueue them (store.py); the loop applies them one after the other, whichever
browser they came from. An action that does not fit the state (the pair is gone, the frame does not exist) changes
nothing but the notice.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from gazeloc_app.state import AppState, Level


class Action(Protocol):
    """One thing that happened."""

    def apply(self, state: AppState) -> AppState:
        """The state after it."""
        ...


@dataclass(frozen=True)
class Notify:
    """Something to tell the user."""

    level: Level
    text: str

    def apply(self, state: AppState) -> AppState:
        """The state with the sentence."""
        return state.noticed(self.level, self.text)
