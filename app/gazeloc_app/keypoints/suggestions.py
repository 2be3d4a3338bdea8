"""The next best place to click, and why, for the panel and the scene: `next_keypoint.suggest` on this project.

Candidates are well-tracked points of the reconstruction, spread evenly, and once there is an alignment only those that
lie on the scan: so the place can be found on both sides.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gazeloc_app.data import ProjectData
from gazeloc_app.placement import shown_scan_from_sfm
from gazeloc_app.state import AppState
from gazeloc_core.alignment.alignment import consensus
from gazeloc_core.alignment.correspondences import Correspondences, gather
from gazeloc_core.alignment.next_keypoint import Suggestion, suggest
from gazeloc_core.arrays import Floats, Ints
from gazeloc_core.keypoints import Point
from gazeloc_core.sfm_model import SfmModel
from gazeloc_core.surfaces.even_sample import even_sample
from gazeloc_core.surfaces.viewpoint import up_vector
from gazeloc_core.transforms import Similarity

CANDIDATES = 500
ON_SCAN_M = 0.04
"""Points of the reconstruction farther from the scan are off, or of things that the scan does not have."""
TRACKED_SHARE = 0.5
"""Of the points, this share that was seen most often is well tracked."""


@dataclass(frozen=True)
class Proposal:
    """A place to click next, in the frames `scan` and `sfm`, and what it is good for, as a sentence."""

    in_scan: Point
    in_sfm: Point
    text: str


class Proposals:
    """The proposal for a state, worked out once for each set of pairs; on the store's loop only."""

    def __init__(self, data: ProjectData):
        self._data = data
        self._known: tuple[object, Proposal | None] = (None, None)

    def of(self, state: AppState) -> Proposal | None:
        """The place to click next; None where suggestions are off, or there is nothing to choose from."""
        model, scan_from_sfm = self._data.model(state.recording), shown_scan_from_sfm(self._data, state)
        if not state.layers.suggests or model is None or scan_from_sfm is None:
            return None
        pairs = gather(self._data.scan_tags(), self._data.sfm_tags(state.recording), state.annotation.keypoints)
        key = (model, scan_from_sfm, pairs.names, pairs.scan.tobytes(), pairs.sfm.tobytes())
        if self._known[0] != key:
            self._known = (key, self._propose(state, model, scan_from_sfm, pairs))
        return self._known[1]

    def _propose(
        self, state: AppState, model: SfmModel, scan_from_sfm: Similarity, pairs: Correspondences
    ) -> Proposal | None:
        rows = well_tracked(model)
        places = scan_from_sfm.apply(model.points[rows])
        if state.annotation.alignment is not None:
            is_on_scan = self._data.raycaster().closest(places).distance <= ON_SCAN_M
            rows, places = rows[is_on_scan], places[is_on_scan]
        cameras = scan_from_sfm.apply(model.sfm_from_camera.translation)
        found = suggest(scan_from_sfm, pairs.take(consensus(pairs)), places, cameras)
        if found is None:
            return None
        up = up_vector(self._data.scan().up_axis)
        in_sfm = model.points[rows[found.candidate]]
        return Proposal(_point(places[found.candidate]), _point(in_sfm), reason(found, len(pairs.group_names), up))


def well_tracked(model: SfmModel) -> Ints:
    """Rows of at most `CANDIDATES` of the points that were seen most often, spread evenly."""
    if len(model.points) == 0:
        return np.zeros(0, np.int64)
    is_good = model.track_lengths >= np.quantile(model.track_lengths, 1 - TRACKED_SHARE)
    rows = np.flatnonzero(is_good & np.isfinite(model.points).all(axis=1))
    return np.asarray(rows[even_sample(model.points[rows], CANDIDATES)], dtype=np.int64)


def reason(found: Suggestion, groups: int, up: Floats) -> str:
    """Why to click there, as a sentence; `groups` is the number of places that hold the alignment so far."""
    if groups < 3:
        ordinal = ("first", "second", "third")[groups]
        return f"“next?” is a good {ordinal} place: well seen, and far from the others. Three pairs make an alignment."
    left = found.weakness_left
    how_much = f"takes {100 * (1 - left):.0f} % off" if left > 0.55 else "halves" if left > 0.4 else "more than halves"
    numbers = (
        f"cameras {100 * found.cameras_before_m:.1f} → {100 * found.cameras_after_m:.1f} cm, "
        f"rotation {found.rotation_before_deg:.2f} → {found.rotation_after_deg:.2f}°"
    )
    weakest = f"the uncertainty of {_weakest_of(found, up)}, the weakest so far"
    return f"A keypoint at “next?” {how_much} {weakest}. Expected error: {numbers}."


def _weakest_of(found: Suggestion, up: Floats) -> str:
    weakness = found.weakness
    if weakness.kind == "scale":
        return "the scale"
    upright = abs(float(np.array(weakness.axis) @ up))
    slant = "vertical" if upright > 0.9 else "horizontal" if upright < 0.4 else "slanted"
    if weakness.kind == "rotation":
        return "the rotation about the vertical" if slant == "vertical" else f"the rotation about a {slant} axis"
    return f"the position, along a {slant} direction" if slant != "vertical" else "the height"


def _point(values: Floats) -> Point:
    x, y, z = (float(value) for value in values)
    return x, y, z
