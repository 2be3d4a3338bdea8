"""What a click in a frame makes: a sighting of the selected keypoint, and the place that all its sightings agree on.

The same for a frame that a page looks through, for one in the panel “Frame”, and for a click that is moved.
"""

from __future__ import annotations

from gazeloc_app.actions.action import Action, Notify
from gazeloc_app.actions.picks import PickSighting, Side
from gazeloc_app.data import ProjectData
from gazeloc_app.frames.frame_snapping import snap_pixel
from gazeloc_app.frames.sightings import triangulated
from gazeloc_app.state import AppState, Level
from gazeloc_core.arrays import Floats
from gazeloc_core.keypoints import KeypointPair, Sighting, add_sighting


def clicked_in_frame(
    data: ProjectData,
    state: AppState,
    side: Side,
    frame: int,
    pixel: Floats,
    *,
    moves: bool = False,
    reach_px: float = 0.0,
) -> list[Action]:
    """The actions of a click at a pixel (2,): what to say, then the sighting.

    It is one of the selected pair, or with `moves` in place of its point there; else it starts a pair. Within
    `reach_px` of a tag's centre or corner it means that.
    """
    x, y, name = float(pixel[0]), float(pixel[1]), ""
    tags = data.seen_tags(None if side is Side.SCAN else state.recording) if reach_px > 0 else None
    snapped = snap_pixel(tags, frame, pixel, reach_px)
    if snapped is not None:
        x, y, name = snapped
    selected = state.annotation.keypoints.get(state.selected_key) if state.selected_key else None
    is_free = selected is not None and (side.point_of(selected) is None or side.sightings_of(selected))
    pair = selected if is_free or moves else None
    return _with_sighting(data, state, side, pair, Sighting(frame, x, y), name)


def moved_in_frame(
    data: ProjectData, state: AppState, side: Side, key: str, frame: int, pixel: tuple[float, float]
) -> list[Action]:
    """The actions that move a pair's click in a frame to a pixel; none where it has no click there."""
    pair = state.annotation.keypoints.get(key)
    if pair is None or click_at(pair, side, frame) is None:
        return []
    return _with_sighting(data, state, side, pair, Sighting(frame, *pixel), "")


def click_at(pair: KeypointPair, side: Side, frame: int) -> Sighting | None:
    """The pair's click in a frame of one side."""
    return next((one for one in side.sightings_of(pair) if one.frame_index == frame), None)


def _with_sighting(
    data: ProjectData, state: AppState, side: Side, pair: KeypointPair | None, sighting: Sighting, name: str
) -> list[Action]:
    if pair is None:
        return [PickSighting(sighting, side=side, name=name)]
    sightings = add_sighting(side.sightings_of(pair), sighting)
    if len(sightings) < 2:
        return [PickSighting(sighting, pair.key, side=side, name=name)]
    found = triangulated(data, state.recording, sightings, side)
    if isinstance(found, str):
        return [Notify(Level.WARNING, found), PickSighting(sighting, pair.key, side=side, name=name)]
    return [PickSighting(sighting, pair.key, *found, side=side, name=name)]
