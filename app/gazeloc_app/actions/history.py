"""Undo and redo over everything that people decide."""

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


def _with_selection_kept(state: AppState) -> AppState:
    keypoints = state.annotation.keypoints
    if state.selected_key is not None and keypoints.get(state.selected_key) is None:
        return replace(state, selected_key=keypoints.pairs[-1].key if len(keypoints) else None)
    return state
