"""Which recording, alignment and method people work with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from gazeloc_app.annotation.history import History
from gazeloc_app.state import AppState
from gazeloc_core.methods import Method


@dataclass(frozen=True)
class ChooseAlignment:
    """A person put an alignment in force, or none."""

    key: str | None

    def apply(self, state: AppState) -> AppState:
        """The state with it."""
        by_person = self.key is not None
        chosen = replace(state.annotation, alignment=self.key, alignment_by_person=by_person, is_live=not by_person)
        return replace(state, fit_note="").annotate(chosen)  # what is chosen stays, whatever is clicked next


@dataclass(frozen=True)
class ChooseMethod:
    """A person wants to see and export another method's poses."""

    method: Method

    def apply(self, state: AppState) -> AppState:
        """The state with it."""
        return state.annotate(replace(state.annotation, method=self.method))


@dataclass(frozen=True)
class CompareMethod:
    """A method's poses shall show beside those of the chosen one, or not."""

    method: Method
    is_shown: bool

    def apply(self, state: AppState) -> AppState:
        """The state with it."""
        others = state.layers.compared - {self.method}
        return state.with_layers(compared=others | {self.method} if self.is_shown else others)


@dataclass(frozen=True)
class OpenRecording:
    """Another recording was opened. `history` gives what people decided about it, asked when the loop gets here."""

    recording: str
    history: Callable[[], History]

    def apply(self, state: AppState) -> AppState:
        """The state of the other recording with its own history; jobs go on, each is about the recording it names."""
        if self.recording == state.recording:
            return state
        opened = replace(
            self.history().with_room_of(state.annotation).put_into(state),
            recording=self.recording,
            selected_key=None,
            frame=0,
            fit_note="",
            is_playing=False,
            notice=None,
            suggested=tuple(other for other in state.suggested if other.recording != self.recording),
            data_revision=state.data_revision + 1,
        )
        for suggested in state.suggested:
            if suggested.recording == self.recording:
                opened = opened.annotate(opened.annotation.with_suggested(suggested))
        return opened
