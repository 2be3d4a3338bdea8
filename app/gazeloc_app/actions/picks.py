"""Clicks that place keypoints: on the scan, in the reconstruction, in frames."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

from gazeloc_app.state import AppState
from gazeloc_core.keypoints import KeypointPair, Point, Sighting, add_sighting


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
    name: str = ""
    """What was hit, where that is known (a tag's corner): names a pair that nobody has named yet."""

    def apply(self, state: AppState) -> AppState:
        """The state with the point placed and its pair selected."""
        keypoints = state.annotation.keypoints
        selected = keypoints.get(state.selected_key) if state.selected_key else None
        fields = self.side.fields(self.point, (), None)
        if selected is not None and (self.move or self.side.point_of(selected) is None):
            if self.name and selected.name == _first_name(selected.key):
                fields["name"] = self.name
            return state.with_keypoints(keypoints.change(selected.key, **fields))
        key = keypoints.next_key()
        pair = KeypointPair(key, self.name or _first_name(key), **fields)
        return replace(state.with_keypoints(keypoints.add(pair)), selected_key=key)


@dataclass(frozen=True)
class MovePoint:
    """A pair's place on one side was dragged or nudged; clicks in that side's frames no longer say where it is."""

    key: str
    point: Point
    side: Side = Side.SCAN

    def apply(self, state: AppState) -> AppState:
        """The state with the place, the pair selected; unchanged where the pair is gone or has no such place."""
        pair = state.annotation.keypoints.get(self.key)
        if pair is None or self.side.point_of(pair) is None:
            return state
        moved = state.annotation.keypoints.change(self.key, **self.side.fields(self.point, (), None))
        return replace(state.with_keypoints(moved), selected_key=self.key)


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
    name: str = ""
    """What was hit, where that is known (a tag's corner): names a pair that nobody has named yet."""

    def apply(self, state: AppState) -> AppState:
        """The state with the sighting and, where it is known, the pair's point on that side; the pair is selected."""
        keypoints = state.annotation.keypoints
        pair = keypoints.get(self.key) if self.key else None
        if pair is None:
            key = keypoints.next_key()
            fields = self.side.fields(None, (self.sighting,), None)
            pair = KeypointPair(key, self.name or _first_name(key), **fields)
            return replace(state.with_keypoints(keypoints.add(pair)), selected_key=key)
        sightings = add_sighting(self.side.sightings_of(pair), self.sighting)
        fields = self.side.fields(self.point, sightings, self.sigma)
        if self.name and pair.name == _first_name(pair.key):
            fields["name"] = self.name
        return replace(state.with_keypoints(keypoints.change(pair.key, **fields)), selected_key=pair.key)


def _first_name(key: str) -> str:
    return f"Keypoint {key[1:]}"
