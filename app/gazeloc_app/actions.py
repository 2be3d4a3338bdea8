"""Everything that can happen, as values: `action.apply(state)` is pure and gives the next state.

Callbacks of the viewer make actions and enqueue them (store.py); the loop applies them one after the other, whichever
browser they came from. An action that does not fit the state (the pair is gone, the frame does not exist) changes
nothing but the notice.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any, Protocol

from gazeloc_app.state import Annotation, AppState, Job, Layer, Level
from gazeloc_core.keypoints import KeypointPair, Point, Sighting, add_sighting
from gazeloc_core.methods import Method


class Action(Protocol):
    """One thing that happened."""

    def apply(self, state: AppState) -> AppState:
        """The state after it."""
        ...


class Side(StrEnum):
    """The two sides of a keypoint pair."""

    SCAN = "scan"
    SFM = "sfm"

    def sightings_of(self, pair: KeypointPair) -> tuple[Sighting, ...]:
        """The pair's clicks in frames on this side."""
        return pair.scan_sightings if self is Side.SCAN else pair.sightings

    def point_of(self, pair: KeypointPair) -> Point | None:
        """The pair's point on this side."""
        return pair.scan if self is Side.SCAN else pair.sfm

    def fields(self, point: Point | None, sightings: tuple[Sighting, ...], sigma: float | None) -> dict[str, Any]:
        """This side of a pair as `KeypointSet.change` takes it."""
        if self is Side.SCAN:
            return {"scan": point, "scan_sightings": sightings, "scan_sigma": sigma}
        return {"sfm": point, "sightings": sightings, "sfm_sigma": sigma}


@dataclass(frozen=True)
class PickPoint:
    """A click gave a point on one side.

    It completes the selected pair if that lacks this side, or moves this side if `move` is set; else it starts a pair.
    """

    side: Side
    point: Point
    move: bool = False

    def apply(self, state: AppState) -> AppState:
        """The state with the point placed and its pair selected."""
        keypoints = state.annotation.keypoints
        selected = keypoints.get(state.selected_key) if state.selected_key else None
        fields = self.side.fields(self.point, (), None)
        if selected is not None and (self.move or self.side.point_of(selected) is None):
            return state.with_keypoints(keypoints.change(selected.key, **fields))
        key = keypoints.next_key()
        pair = KeypointPair(key, f"Keypoint {key[1:]}", **fields)
        return replace(state.with_keypoints(keypoints.add(pair)), selected_key=key)


@dataclass(frozen=True)
class PickSighting:
    """A click in a frame, kept with the pair `key` (None: a new pair); a second one in a frame replaces the first.

    `side` says whose frames they are: the recording's or the phone's. `point` is what all of the pair's sightings on
    that side triangulate to, with its standard deviation; None while there are fewer than two.
    """

    sighting: Sighting
    key: str | None = None
    point: Point | None = None
    sigma: float | None = None
    side: Side = Side.SFM

    def apply(self, state: AppState) -> AppState:
        """The state with the sighting and, where it is known, the pair's point on that side."""
        keypoints = state.annotation.keypoints
        pair = keypoints.get(self.key) if self.key else None
        if pair is None:
            key = keypoints.next_key()
            fields = self.side.fields(None, (self.sighting,), None)
            pair = KeypointPair(key, f"Keypoint {key[1:]}", **fields)
            return replace(state.with_keypoints(keypoints.add(pair)), selected_key=key)
        sightings = add_sighting(self.side.sightings_of(pair), self.sighting)
        return state.with_keypoints(keypoints.change(pair.key, **self.side.fields(self.point, sightings, self.sigma)))


@dataclass(frozen=True)
class SelectPair:
    """A pair was selected, or none: the next click then starts a new one."""

    key: str | None

    def apply(self, state: AppState) -> AppState:
        """The state with the selection."""
        known = self.key is None or state.annotation.keypoints.get(self.key) is not None
        return replace(state, selected_key=self.key) if known else state


@dataclass(frozen=True)
class RenamePair:
    """A pair got another name."""

    key: str
    name: str

    def apply(self, state: AppState) -> AppState:
        """The state with the name; an empty one is refused."""
        name = " ".join(self.name.split())[:60]
        if not name:
            return state.noticed(Level.WARNING, "A keypoint needs a name.")
        return state.with_keypoints(state.annotation.keypoints.change(self.key, name=name))


@dataclass(frozen=True)
class EnablePair:
    """A pair shall count, or not."""

    key: str
    enabled: bool

    def apply(self, state: AppState) -> AppState:
        """The state with the pair switched."""
        return state.with_keypoints(state.annotation.keypoints.change(self.key, enabled=self.enabled))


@dataclass(frozen=True)
class DeletePair:
    """A pair was deleted."""

    key: str

    def apply(self, state: AppState) -> AppState:
        """The state without it, the one before it selected."""
        pairs = state.annotation.keypoints.pairs
        keys = [pair.key for pair in pairs]
        if self.key not in keys:
            return state
        at = keys.index(self.key)
        rest = keys[:at] + keys[at + 1 :]
        selected = rest[max(0, at - 1)] if rest else None
        return replace(state.with_keypoints(state.annotation.keypoints.remove(self.key)), selected_key=selected)


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


@dataclass(frozen=True)
class ChooseAlignment:
    """A person put an alignment in force, or none."""

    key: str | None

    def apply(self, state: AppState) -> AppState:
        """The state with it."""
        return state.annotate(replace(state.annotation, alignment=self.key, alignment_by_person=self.key is not None))


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
        compared = state.compared | {self.method} if self.is_shown else state.compared - {self.method}
        return replace(state, compared=compared)


@dataclass(frozen=True)
class OpenRecording:
    """Another recording was opened, with what people decided about it so far."""

    recording: str
    annotation: Annotation

    def apply(self, state: AppState) -> AppState:
        """The state of the other recording, its undo list empty; refused while a job is about the one that is open."""
        if state.job is not None:
            return state.noticed(Level.WARNING, f"“{state.job.name}” is still running; wait for it or cancel it.")
        return replace(
            AppState(state.recordings, self.recording, self.annotation),
            layers=state.layers,
            compared=state.compared,
            draws_tags=state.draws_tags,
            data_revision=state.data_revision + 1,
            renderer_note=state.renderer_note,
            jobs_started=state.jobs_started,
        )


@dataclass(frozen=True)
class ShowFrame:
    """A frame of the recording was chosen."""

    frame: int

    def apply(self, state: AppState) -> AppState:
        """The state with the frame."""
        return replace(state, frame=max(0, self.frame))


@dataclass(frozen=True)
class DrawTags:
    """The tags that were found shall be drawn into the frame, or not."""

    is_on: bool

    def apply(self, state: AppState) -> AppState:
        """The state with it."""
        return replace(state, draws_tags=self.is_on)


@dataclass(frozen=True)
class ShowLayer:
    """A layer was switched on or off."""

    layer: Layer
    is_visible: bool

    def apply(self, state: AppState) -> AppState:
        """The state with the layer switched."""
        return replace(state, layers=state.layers.with_visible(self.layer, self.is_visible))


@dataclass(frozen=True)
class TintLayer:
    """A layer was tinted, or got its own colours back."""

    layer: Layer
    tint: tuple[int, int, int] | None

    def apply(self, state: AppState) -> AppState:
        """The state with the tint."""
        return replace(state, layers=state.layers.with_tint(self.layer, self.tint))


@dataclass(frozen=True)
class NameRenderer:
    """The renderer of pictures is known; `note` is the sentence to show where it stands in for the usual one."""

    note: str

    def apply(self, state: AppState) -> AppState:
        """The state with the sentence."""
        return replace(state, renderer_note=self.note)


@dataclass(frozen=True)
class Notify:
    """Something to tell the user."""

    level: Level
    text: str

    def apply(self, state: AppState) -> AppState:
        """The state with the sentence."""
        return state.noticed(self.level, self.text)


@dataclass(frozen=True)
class StartJob:
    """The user asked for long work: `task` of tasks.py with its keywords. One piece at a time."""

    name: str
    task: Callable[..., Any]
    keywords: tuple[tuple[str, Any], ...] = ()

    def apply(self, state: AppState) -> AppState:
        """The state with the job, which an effect then starts; refused while another is under way."""
        if state.job is not None:
            return state.noticed(Level.WARNING, f"“{state.job.name}” is still running; wait for it or cancel it.")
        number = state.jobs_started + 1
        job = Job(self.name, self.task, self.keywords, number=number)
        return replace(state, job=job, jobs_started=number, notice=None)


@dataclass(frozen=True)
class JobProgressed:
    """Long work got on."""

    fraction: float
    text: str

    def apply(self, state: AppState) -> AppState:
        """The state with the progress."""
        return (
            state
            if state.job is None
            else replace(state, job=replace(state.job, fraction=self.fraction, text=self.text))
        )


@dataclass(frozen=True)
class JobCancelling:
    """The user asked running work to stop."""

    def apply(self, state: AppState) -> AppState:
        """The state that says so."""
        return state if state.job is None else replace(state, job=replace(state.job, is_cancelling=True))


@dataclass(frozen=True)
class JobEnded:
    """Long work ended, well or not; `alignment` is the one it suggests to put in force."""

    level: Level
    text: str
    alignment: str | None = None
    by_person: bool = False

    def apply(self, state: AppState) -> AppState:
        """The state without the job, with its news and its alignment (which can be undone).

        An alignment that a run suggests never replaces one that a person chose.
        """
        state = replace(state, job=None, data_revision=state.data_revision + 1)
        is_free = self.by_person or not state.annotation.alignment_by_person
        if is_free and self.alignment is not None and self.alignment != state.annotation.alignment:
            chosen = replace(state.annotation, alignment=self.alignment, alignment_by_person=self.by_person)
            state = state.annotate(chosen)
        return state.noticed(self.level, self.text)
