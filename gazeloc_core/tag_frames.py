"""Frames that are reconstructed for the tags in them, beside the keyframes.

Keyframes are chosen by sharpness and motion, before anything is known about tags, and may miss most sightings of a tag.
But a reconstruction is aligned by its tags: each needs some frames, from different places. Frames in which a tag was
read are sharp enough to be worth it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gazeloc_core.arrays import Bools, Ints
from gazeloc_core.tag_types import TagSightings


@dataclass(frozen=True, kw_only=True)
class TagFrameOptions:
    """How many frames are added for tags."""

    sightings_per_tag: int = 8
    """A tag that fewer keyframes show gets frames up to this number; 0 adds none."""
    least_gap_s: float = 0.12
    """Frames nearer than this to one that shows the tag already are not worth it."""


def frames_for_tags(
    timestamp_ns: Ints, keyframes: Ints, sightings: TagSightings, options: TagFrameOptions | None = None
) -> Ints:
    """The frames (F,), rising and none of them a keyframe, that give each tag enough sightings, as far as there are.

    `timestamp_ns` (N,) are the times of all frames, `keyframes` the indices of those that are reconstructed anyway. Of
    a tag's frames the one furthest in time from those that count already comes next: the person has moved by then.
    """
    options = options or TagFrameOptions()
    chosen = np.zeros(len(timestamp_ns), dtype=np.bool_)
    chosen[np.asarray(keyframes, dtype=np.int64)] = True
    is_keyframe = chosen.copy()
    tags, counts = np.unique(sightings.tag_id, return_counts=True)
    for tag in tags[np.argsort(counts, kind="stable")]:  # rare tags first, their frames may show others too
        _add(timestamp_ns, sightings.frame_index[sightings.tag_id == tag], chosen, options)
    return np.flatnonzero(chosen & ~is_keyframe)


def _add(timestamp_ns: Ints, frames: Ints, chosen: Bools, options: TagFrameOptions) -> None:
    """Mark frames among those that show one tag, until enough of them are `chosen`."""
    times = timestamp_ns[frames]
    while chosen[frames].sum() < min(options.sightings_per_tag, len(frames)):
        known = times[chosen[frames]]
        away = np.abs(times[:, None] - known[None]).min(axis=1) if len(known) else np.ones(len(times)) * 1e18
        if away.max() < options.least_gap_s * 1e9:
            return
        chosen[frames[away.argmax()]] = True
