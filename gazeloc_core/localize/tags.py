"""Poses of a recording's frames in the scan, from tags alone (method `tags`).

The paper's pipeline 1 with all sightings joined: the tags are mapped from all posed frames of the phone, and all mapped
tags of a glasses frame give one pose. A frame's two possible poses are told apart by its picture, by walls, and by its
neighbours in time; where that fails the frame is rejected. Then all poses are adjusted together.

- `tag_only`: the frame shows a tag of the scan, and its pose is supported by it.
- `rejected`: it shows one, but two poses remain possible, or its tags contradict its neighbours.
- `none`: it shows no tag of the scan. It never gets a pose from its neighbours.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gazeloc_core.arrays import Floats, Ints
from gazeloc_core.camera import Camera
from gazeloc_core.localize.resection import TagErrors
from gazeloc_core.localize.tag_candidates import Candidates, MappedSightings, WallOptions, find_candidates
from gazeloc_core.localize.tag_localization import (
    LocalizedFrames,
    TagLocalization,
    check_sightings,
    tag_localization,
    unmapped_note,
)
from gazeloc_core.localize.tag_path import NO_CANDIDATE, PathOptions, are_tied, choose_path
from gazeloc_core.localize.tag_smoother import SmootherOptions, TagChain, smooth
from gazeloc_core.progress import Report, silent
from gazeloc_core.surfaces.raycast import Raycaster
from gazeloc_core.tag_types import TagCorners, TagSightings

_OFTEN = 0.3
_LEAST_SIGHTINGS = 5


@dataclass(frozen=True, kw_only=True)
class LocalizeTagsOptions:
    """What is assumed about detected tags and about heads (standard deviations), and when a frame is rejected."""

    corner_error_px: float = 0.7
    """Detected corners, per axis. Errors of neighbouring frames are alike, so this is more than one frame's noise."""
    place_error_m: float = 0.01
    """Places of tags on the scan, per axis."""
    outlier: float = 4.0
    """Tags that are off by more than this many times these errors do not agree."""
    edge_shift_error_px: float = 0.5
    """How far tags may look too small or too large all round."""
    speed_m_per_s: float = 1.0
    """Speed of the head, per axis."""
    spin_deg_per_s: float = 100.0
    """Angular speed of the head, per axis."""
    velocity_change_m_per_s: float = 1.0
    """Change of the head's velocity over a second, per axis; it grows with the root of time."""
    spin_change_deg_per_s: float = 500.0
    """Change of its angular velocity over a second, per axis; it grows with the root of time."""
    wall_clearance_m: float = 0.15
    """A wall nearer than the tag by more than this speaks against a pose that sees the tag through it."""
    sure_gap: float = 4.0
    """Log-likelihood by which a pose must beat all others of its frame; 4 is 50 to 1."""

    @property
    def errors(self) -> TagErrors:
        """How the corners are weighed."""
        return TagErrors(corner_error_px=self.corner_error_px, place_error_m=self.place_error_m, outlier=self.outlier)

    @property
    def path(self) -> PathOptions:
        """How poses are chosen."""
        return PathOptions(speed_m_per_s=self.speed_m_per_s, spin_deg_per_s=self.spin_deg_per_s, sure_gap=self.sure_gap)

    @property
    def smoother(self) -> SmootherOptions:
        """How poses are adjusted."""
        return SmootherOptions(
            velocity_change_m_per_s=self.velocity_change_m_per_s,
            spin_change_deg_per_s=self.spin_change_deg_per_s,
            speed_m_per_s=self.speed_m_per_s,
            spin_deg_per_s=self.spin_deg_per_s,
            edge_shift_error_px=self.edge_shift_error_px,
        )


def localize_tags(
    timestamp_ns: Ints,
    keyframes: Ints,
    camera: Camera,
    sightings: TagSightings,
    corners: TagCorners,
    options: LocalizeTagsOptions | None = None,
    *,
    raycaster: Raycaster | None = None,
    report: Report = silent,
) -> TagLocalization:
    """The poses of a recording with times (N,), from its tag sightings and the tags' `corners` in the scan.

    `camera` is the pinhole camera in whose frames the tags were seen; `raycaster` casts at the scan's mesh, without it
    walls are no evidence.

    Raises:
        GeometryError: if sightings or keyframes are not of this recording.
        Cancelled: when `report` raises it.
    """
    options = options or LocalizeTagsOptions()
    times = np.asarray(timestamp_ns, dtype=np.int64)
    check_sightings(sightings, len(times))
    seconds = (times - times[:1]) / 1e9
    seen = MappedSightings.of(sightings, corners, camera)
    report(0.0, f"Solving for poses from {len(seen)} sightings of {len(corners)} tags on the scan")
    walls = WallOptions(clearance_m=options.wall_clearance_m)
    candidates = find_candidates(seen, camera, options.errors, walls, raycaster)
    report(0.5, "Choosing between each tag's two poses")
    chosen = choose_path(candidates, seconds, options.path)
    is_sure = (chosen.candidate != NO_CANDIDATE) & ~chosen.is_open
    report(0.6, "Adjusting all poses together")
    found = _adjusted(seen, candidates, chosen.candidate[is_sure], camera, seconds, options)
    rejected = np.setdiff1d(seen.frame, found.frame)
    ambiguous = chosen.frame[chosen.is_open]
    notes = (
        *unmapped_note(sightings, corners.tag_id),
        *_rejection_notes(len(rejected), len(ambiguous)),
        *_outlier_notes(candidates, chosen.candidate[is_sure], seen, corners),
    )
    report(1.0, " ".join(notes) or f"{len(found.frame)} frames localised by tags")
    return tag_localization(times, keyframes, found, rejected, ambiguous, notes)


def _adjusted(
    seen: MappedSightings,
    candidates: Candidates,
    rows: Ints,
    camera: Camera,
    seconds: Floats,
    options: LocalizeTagsOptions,
) -> LocalizedFrames:
    """The chosen candidates `rows` after `smooth`, without those frames of which no tag agrees with them any more."""
    kept = candidates.pick(rows)
    every = seen.squares(kept.views, kept.owner, kept.is_used, camera)
    if len(rows) == 0:
        return LocalizedFrames(kept.frame, kept.poses, every, kept.is_used)
    chain = TagChain(every.pick(kept.is_used), seconds[kept.frame], are_tied(kept, seconds, options.path))
    answer = smooth(chain, kept.poses, options.errors, options.smoother)
    is_used = kept.is_used.copy()
    is_used[kept.is_used] = options.errors.agrees(answer.chi2)
    is_supported = np.bincount(kept.owner, is_used, minlength=len(rows)) > 0
    every = every.without_edge_shift(answer.edge_shift_px)
    return LocalizedFrames(kept.frame, answer.poses, every, is_used).pick(is_supported)


def _rejection_notes(rejected: int, ambiguous: int) -> tuple[str, ...]:
    if rejected == 0:
        return ()
    reasons = [f"{ambiguous} because two poses fit equally well"] if ambiguous else []
    if rejected > ambiguous:
        reasons.append(f"{rejected - ambiguous} because their tags contradict the frames around them")
    return (f"{rejected} frames that show a tag of the scan were rejected: {', '.join(reasons)}.",)


def _outlier_notes(candidates: Candidates, rows: Ints, seen: MappedSightings, corners: TagCorners) -> tuple[str, ...]:
    """A sentence for each tag that often contradicts the other tags of its frames."""
    kept = candidates.pick(rows)
    shared = np.bincount(kept.owner, minlength=len(kept))[kept.owner] > 1
    tag, is_used = seen.tag[kept.views[shared]], kept.is_used[shared]
    count, off = np.bincount(tag, minlength=len(corners)), np.bincount(tag[~is_used], minlength=len(corners))
    return tuple(
        f"Tag {corners.tag_id[k]} contradicts the other tags in {off[k]} of {count[k]} frames; was it moved?"
        for k in np.flatnonzero((count >= _LEAST_SIGHTINGS) & (off > _OFTEN * count)).tolist()
    )
