"""Playing the recording: the frame that all browsers show goes on by itself."""

from __future__ import annotations

from dataclasses import dataclass, replace

from gazeloc_app.state import AppState

SPEEDS = (0.25, 0.5, 1.0, 2.0, 4.0)
"""How many seconds of the recording pass in a second."""


@dataclass(frozen=True)
class Play:
    """Play, or stand still."""

    is_on: bool

    def apply(self, state: AppState) -> AppState:
        """The state with it."""
        return replace(state, is_playing=self.is_on)


@dataclass(frozen=True)
class TogglePlay:
    """Play what stands still, and the other way round."""

    def apply(self, state: AppState) -> AppState:
        """The state with it."""
        return replace(state, is_playing=not state.is_playing)


@dataclass(frozen=True)
class SetSpeed:
    """Play faster or slower."""

    speed: float

    def apply(self, state: AppState) -> AppState:
        """The state with the speed; one that is not offered changes nothing."""
        return replace(state, speed=self.speed) if self.speed in SPEEDS else state


@dataclass(frozen=True)
class PlayOn:
    """The player got to a frame; it does not count where somebody stopped it or opened another recording meanwhile."""

    recording: str
    frame: int

    def apply(self, state: AppState) -> AppState:
        """The state with the frame."""
        is_meant = state.is_playing and state.recording == self.recording
        return replace(state, frame=max(0, self.frame)) if is_meant else state
