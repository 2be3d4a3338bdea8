"""What the number of tags in a room does (the paper, section IX), from one recording: each draw keeps some of its tags.

detection rate = #(frames with detected poses) / #(frames)
validity       = #(frames with detected poses within the safe range) / #(frames with detected poses)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from math import comb

import numpy as np
from scipy.spatial.transform import RigidTransform

from gazeloc_core.arrays import Bools, Floats, Ints, frozen
from gazeloc_core.camera import Camera
from gazeloc_core.errors import InputError
from gazeloc_core.tag_quality.analysis import viewing_angles_deg
from gazeloc_core.tag_types import TagCorners, TagSightings
from gazeloc_core.tags.square import rotation_of_square


@dataclass(frozen=True, kw_only=True)
class TagCountOptions:
    """How tags are drawn."""

    draws: int = 60
    """Draws per number of tags; where there are fewer ways to choose them, each is taken once."""
    seed: int = 1
    """Seed of the draws."""


@dataclass(frozen=True, eq=False)
class TagCounts:
    """D draws: `tags` (D,) how many were kept, `detection_rate` (D,), `validity` (D,), NaN where no tag was found."""

    tags: Ints
    detection_rate: Floats
    validity: Floats

    def __post_init__(self) -> None:
        object.__setattr__(self, "tags", frozen(self.tags, np.int64))
        object.__setattr__(self, "detection_rate", frozen(self.detection_rate))
        object.__setattr__(self, "validity", frozen(self.validity))


def tag_counts(
    sightings: TagSightings,
    is_safe: Bools,
    frame_count: int,
    tag_ids: Sequence[int],
    options: TagCountOptions | None = None,
) -> TagCounts:
    """The rates for draws of 1 to all tags of the room, `tag_ids`, whether or not they were ever seen.

    `is_safe` (S,) says of each sighting whether it lies in the safe range; frames are 0 to `frame_count` - 1.

    Raises:
        InputError: if there are no frames, tags or draws, or a sighting is of another frame or tag.
    """
    options = options or TagCountOptions()
    column_of = {tag_id: column for column, tag_id in enumerate(tag_ids)}
    strange = sorted(set(sightings.tag_id.tolist()) - set(column_of))
    if strange or not column_of:
        raise InputError(
            f"The room has the tags {list(tag_ids)}, but tags {strange} were seen; name all of the room's."
        )
    if options.draws < 1 or frame_count <= int(sightings.frame_index.max(initial=0)):
        raise InputError(f"{options.draws} draws from {frame_count} frames are too few for these sightings.")
    columns = np.array([column_of[tag_id] for tag_id in sightings.tag_id.tolist()], dtype=np.int64)
    seen = np.zeros((2, frame_count, len(column_of)), dtype=np.bool_)
    seen[0, sightings.frame_index, columns] = True
    seen[1, sightings.frame_index[is_safe], columns[is_safe]] = True
    rng = np.random.default_rng(options.seed)
    rows = []
    for count in range(1, len(column_of) + 1):
        for chosen in _choices(len(column_of), count, options.draws, rng):
            found, safe = seen[:, :, list(chosen)].any(axis=2).sum(axis=1)
            rows.append((count, found / frame_count, safe / found if found else np.nan))
    tags, detection, validity = np.array(rows).T
    return TagCounts(tags, detection, validity)


def true_views(
    sightings: TagSightings,
    cameras: Camera | Sequence[Camera],
    scan_from_camera: RigidTransform,
    places: TagCorners,
    tag_size_m: float,
) -> tuple[Floats, Floats]:
    """Pixels per tag (S,) and viewing angle in degrees (S,) of sightings, by true poses (S,) and the tags' true places.

    NaN where the tag has no place.
    """
    each = [cameras] * len(sightings) if isinstance(cameras, Camera) else list(cameras)
    row_of = {int(tag_id): row for row, tag_id in enumerate(places.tag_id)}
    rows = [row_of.get(tag_id) for tag_id in sightings.tag_id.tolist()]
    corners = np.array([places.corners[row] if row is not None else np.full((4, 3), np.nan) for row in rows])
    turn, at = scan_from_camera.rotation.as_matrix().reshape(-1, 3, 3), scan_from_camera.translation.reshape(-1, 3)
    centres = np.einsum("sji,sj->si", turn, corners.reshape(-1, 4, 3).mean(axis=1) - at)
    squares = np.array([rotation_of_square(c) if np.isfinite(c).all() else np.full((3, 3), np.nan) for c in corners])
    _, angle = viewing_angles_deg(np.einsum("sji,sjk->sik", turn, squares.reshape(-1, 3, 3)), centres)
    focal = np.array([camera.focal_px.mean() for camera in each])
    return focal * tag_size_m / np.linalg.norm(centres, axis=1), angle


def _choices(total: int, count: int, draws: int, rng: np.random.Generator) -> list[tuple[int, ...]]:
    """Ways to choose `count` of `total`: all where there are no more than `draws`, else that many at random."""
    if comb(total, count) <= draws:
        return list(combinations(range(total), count))
    return [tuple(rng.choice(total, count, replace=False).tolist()) for _ in range(draws)]
