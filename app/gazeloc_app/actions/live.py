"""Alignments that follow the keypoints."""

from __future__ import annotations

from dataclasses import dataclass, replace

from gazeloc_app.state import AppState
from gazeloc_core.keypoints import KeypointSet


@dataclass(frozen=True)
class FollowKeypoints:
    """The alignment shall follow every change of the keypoints, or not."""

    is_on: bool

    def apply(self, state: AppState) -> AppState:
        """The state with it; switched on, the keypoints are fitted at once (live_alignment.py)."""
        state = state.annotate(replace(state.annotation, is_live=self.is_on))
        return replace(state, live_asked=state.live_asked + int(self.is_on), fit_note="")


@dataclass(frozen=True)
class FitFound:
    """The keypoints of a recording were fitted: by the alignment `key`, or by none, and `note` says why.

    `is_step`: a person asked for the fit by itself, so it is a step to undo, one with that of asking. Else it is part
    of the step that changed the keypoints: one undo takes both back.
    """

    recording: str
    keypoints: KeypointSet
    key: str | None
    note: str = ""
    is_step: bool = False

    def apply(self, state: AppState) -> AppState:
        """The state with the fit in force; an answer to keypoints that have changed since is dropped."""
        asked_for = (self.recording, self.keypoints) == (state.recording, state.annotation.keypoints)
        if not asked_for or not state.annotation.is_live:
            return state
        state = replace(state, fit_note=self.note)
        if self.key is None or self.key == state.annotation.alignment:
            return state
        annotation = replace(state.annotation, alignment=self.key, alignment_by_person=True)
        is_asking = bool(state.past) and state.annotation == replace(state.past[-1], is_live=True)
        is_own = self.is_step and not is_asking
        return state.annotate(annotation) if is_own else replace(state, annotation=annotation)
