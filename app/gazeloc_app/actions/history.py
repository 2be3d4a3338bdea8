"""Undo, redo and going to any step, over everything that people decide."""

from __future__ import annotations

from dataclasses import dataclass, replace

from gazeloc_app.state import AppState, Level


@dataclass(frozen=True)
class Undo:
    """One step back."""

    def apply(self, state: AppState) -> AppState:
        """The state with the annotation before."""
        if not state.past:
            return state.noticed(Level.INFO, "There is nothing to undo.")
        return _with_selection_kept(
            replace(
                state,
                annotation=state.past[-1],
                past=state.past[:-1],
                future=(state.annotation, *state.future),
            )
        )


@dataclass(frozen=True)
class Redo:
    """One step forward again."""

    def apply(self, state: AppState) -> AppState:
        """The state with the annotation that was undone."""
        if not state.future:
            return state.noticed(Level.INFO, "There is nothing to redo.")
        return _with_selection_kept(
            replace(
                state,
                annotation=state.future[0],
                past=(*state.past, state.annotation),
                future=state.future[1:],
            )
        )


@dataclass(frozen=True)
class GoToStep:
    """A step in the visible list of `count` steps was chosen; 0 is the beginning."""

    step: int
    count: int

    def apply(self, state: AppState) -> AppState:
        """The state as it was after that step; all others stay in the list."""
        steps = (*state.past, state.annotation, *state.future)
        if self.count != len(steps) or not 0 <= self.step < len(steps):
            return state.noticed(Level.INFO, "The list of steps has changed meanwhile; choose again.")
        present, past, future = steps[self.step], steps[: self.step], steps[self.step + 1 :]
        return _with_selection_kept(replace(state, annotation=present, past=past, future=future))


def _with_selection_kept(state: AppState) -> AppState:
    keypoints = state.annotation.keypoints
    if state.selected_key is not None and keypoints.get(state.selected_key) is None:
        return replace(state, selected_key=keypoints.pairs[-1].key if len(keypoints) else None)
    return state
