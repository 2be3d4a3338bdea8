"""Where the tags of a frame may put its camera: each tag has two answers, and each answer takes the others along.

A candidate starts at one of the two planar poses of one tag of the frame, known in the scan, and is adjusted to all
tags that agree with it. So a frame with two good tags has several candidates that end in the same place, which are
joined, and wrong ones at a high cost; a frame with one tag keeps two, whose costs say how well its picture tells them
apart. The cost is minus the logarithm of a likelihood, 0 for a pose that explains none of the frame's tags:

- each tag takes 10 off, less half its squared reprojection error; one wrong tag does no more harm than one tag;
- a wall between the camera and a tag that it sees adds to it, where there is a mesh to cast rays at.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np

from gazeloc_core.arrays import Bools, Floats, Ints
from gazeloc_core.camera import Camera
from gazeloc_core.localize.resection import CameraPoses, SeenSquares, TagErrors, resect
from gazeloc_core.surfaces.raycast import Raycaster
from gazeloc_core.tag_types import TagCorners, TagSightings
from gazeloc_core.tags.pose import normalised_corners, tag_poses
from gazeloc_core.tags.square import rotation_of_square

_MOST_PER_FRAME = 6
_SAME_M = 0.03
_SAME_DEG = 2.0
_HOPELESS = 30.0
_COST_OF_OUTLIER = 10.0


@dataclass(frozen=True, kw_only=True)
class WallOptions:
    """What a wall between the camera and a tag that it sees says."""

    wall_cost: float = 6.0
    """What it speaks against a pose, as a log-likelihood."""
    clearance_m: float = 0.15
    """It counts if it is nearer to the camera than the tag by more than this."""


@dataclass(frozen=True, eq=False)
class MappedSightings:
    """V sightings of tags that are on the scan, by rising frame: `frame` (V,), `tag` (V,) rows of the tags' columns.

    `corners_px` (V, 4, 2); `normalised` (V, 4, 2) their rays' x/z and y/z; `corners` (V, 4, 3) in the scan.
    """

    frame: Ints
    tag: Ints
    corners_px: Floats
    normalised: Floats
    corners: Floats

    def __len__(self) -> int:
        return len(self.frame)

    @classmethod
    def of(cls, sightings: TagSightings, corners: TagCorners, camera: Camera) -> MappedSightings:
        """The sightings whose tag is among `corners`."""
        row_of = {tag_id: row for row, tag_id in enumerate(corners.tag_id.tolist())}
        tag = np.array([row_of.get(tag_id, -1) for tag_id in sightings.tag_id.tolist()], dtype=np.int64)
        row = np.flatnonzero(tag >= 0)
        row = row[np.argsort(sightings.frame_index[row], kind="stable")]
        pixels = sightings.corners_px[row]
        normalised = normalised_corners(pixels, camera)
        return cls(sightings.frame_index[row], tag[row], pixels, normalised, corners.corners[tag[row]])

    def squares(self, rows: Ints, pose: Ints, is_seed: Bools, camera: Camera) -> SeenSquares:
        """Sightings `rows` (W,) as views of the poses `pose` (W,)."""
        return SeenSquares(pose, self.corners[rows], self.normalised[rows], camera.focal_px, is_seed)


@dataclass(frozen=True, eq=False)
class Candidates:
    """C candidate poses by rising `frame` (C,): `poses`, `covariance` (C, 6, 6), `cost` (C,).

    What each sees: `views` (W,) numbers the sightings of its frame, `owner` (W,) is the candidate, `is_used` (W,) says
    whether the sighting agrees with it.
    """

    frame: Ints
    poses: CameraPoses
    covariance: Floats
    cost: Floats
    owner: Ints
    views: Ints
    is_used: Bools

    def __len__(self) -> int:
        return len(self.frame)

    def pick(self, rows: Ints) -> Candidates:
        """Some of the candidates, rows rising."""
        new = np.full(len(self), -1)
        new[rows] = np.arange(len(rows))
        mine = new[self.owner] >= 0
        return Candidates(
            self.frame[rows],
            self.poses[rows],
            self.covariance[rows],
            self.cost[rows],
            new[self.owner[mine]],
            self.views[mine],
            self.is_used[mine],
        )


def find_candidates(
    seen: MappedSightings, camera: Camera, errors: TagErrors, walls: WallOptions, raycaster: Raycaster | None = None
) -> Candidates:
    """The candidates of all frames that show a tag of the scan; a frame whose tags have no planar pose has none."""
    frame, seed, start = _planar_starts(seen, camera)
    owner, views = _views_of(seen.frame, frame)
    is_seed = np.asarray(views == seed[owner])
    answer = resect(seen.squares(views, owner, is_seed, camera), start, errors)
    agrees = errors.agrees(answer.chi2)
    gained = np.maximum(_COST_OF_OUTLIER - answer.chi2 / 2, 0.0)
    cost = -np.asarray(np.bincount(owner, gained, minlength=len(frame)), dtype=np.float64)
    every = Candidates(frame, answer.poses, answer.covariance, cost, owner, views, agrees)
    kept = every.pick(_distinct(every))
    if raycaster is None:
        return kept
    return replace(kept, cost=kept.cost + walls.wall_cost * _walls(kept, seen, raycaster, walls.clearance_m))


def _planar_starts(seen: MappedSightings, camera: Camera) -> tuple[Ints, Ints, CameraPoses]:
    """Frame (P,), sighting (P,) and pose of every planar answer, by rising frame."""
    sides = np.linalg.norm(seen.corners - np.roll(seen.corners, 1, axis=1), axis=2).mean(axis=1)
    planar = tag_poses(seen.corners_px, camera, sides)
    scan_from_tag = np.array([rotation_of_square(square) for square in seen.corners]).reshape(-1, 3, 3)
    turn = np.einsum("vij,vkpj->vkip", scan_from_tag, planar.rotation)  # scan_from_tag · tag_from_camera
    centre = seen.corners.mean(axis=1)[:, None] - np.einsum("vkij,vkj->vki", turn, planar.translation)
    sighting, which = np.nonzero(np.isfinite(planar.rms_px))
    return seen.frame[sighting], sighting, CameraPoses(centre[sighting, which], turn[sighting, which])


def _views_of(frame_of_sighting: Ints, frame: Ints) -> tuple[Ints, Ints]:
    """Each candidate's number, repeated for every sighting (W,) of its frame, and those sightings' numbers (W,)."""
    first, last = (np.searchsorted(frame_of_sighting, frame, side=side) for side in ("left", "right"))
    count = last - first
    owner = np.repeat(np.arange(len(frame)), count)
    within = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
    return owner, np.asarray(first[owner] + within)


def _distinct(every: Candidates) -> Ints:
    """The rows to keep: the cheapest of those that are the same pose, the best few of each frame."""
    kept: list[int] = []
    starts = np.flatnonzero(np.diff(every.frame, prepend=-1)).tolist()
    for first, last in itertools.pairwise([*starts, len(every)]):
        mine: list[int] = []
        for row in (first + np.argsort(every.cost[first:last], kind="stable")).tolist():
            hopeless = mine and every.cost[row] > every.cost[mine[0]] + _HOPELESS
            if len(mine) < _MOST_PER_FRAME and not hopeless and not any(_are_same(every, row, other) for other in mine):
                mine.append(row)
        kept += sorted(mine)
    return np.array(kept, dtype=np.int64)


def _are_same(every: Candidates, a: int, b: int) -> bool:
    apart = np.linalg.norm(every.poses.centers[a] - every.poses.centers[b])
    cosine = (np.sum(every.poses.rotations[a] * every.poses.rotations[b]) - 1) / 2
    return bool(apart < _SAME_M and cosine > np.cos(np.radians(_SAME_DEG)))


def _walls(kept: Candidates, seen: MappedSightings, raycaster: Raycaster, clearance_m: float) -> Floats:
    """(C,) how many of the tags that agree with a candidate it sees through a wall."""
    owner, views = kept.owner[kept.is_used], kept.views[kept.is_used]
    origin = kept.poses.centers[owner]
    toward = seen.corners[views].mean(axis=1) - origin
    length = np.linalg.norm(toward, axis=1)
    hit = raycaster.cast(origin, toward / length[:, None]).distance
    is_hidden = np.asarray(hit < length - clearance_m, dtype=np.float64)
    return np.asarray(np.bincount(owner, is_hidden, minlength=len(kept)), dtype=np.float64)
