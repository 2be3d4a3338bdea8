"""Pairs of a place on the scan and the same place in the reconstruction, ready to be aligned.

Pairs come in groups that are right or wrong together: the four corners of a tag are one group (one mistaken
detection, one drifting phone pose spoils all four), a clicked keypoint is a group of its own.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gazeloc_core.arrays import Bools, Floats, Ints, frozen
from gazeloc_core.errors import GeometryError
from gazeloc_core.keypoints import KeypointSet
from gazeloc_core.tag_types import TagCorners

TAG_SIGMA_M = 0.01
"""Expected error of a tag's corner per axis, both sides together, in metres on the scan."""
CLICKED_SIGMA_M = 0.02
"""The same of a clicked keypoint."""
_ROUGH_PAIRS = 300


@dataclass(frozen=True, eq=False)
class Correspondences:
    """K pairs: `names` and `groups` (K,), `sfm` (K, 3), `scan` (K, 3) in metres, `sigma_m` (K,).

    `sigma_m` is the expected error of a pair per axis, both sides together, in metres on the scan.
    """

    names: tuple[str, ...]
    groups: tuple[str, ...]
    sfm: Floats
    scan: Floats
    sigma_m: Floats

    def __post_init__(self) -> None:
        object.__setattr__(self, "sfm", frozen(np.reshape(self.sfm, (-1, 3))))
        object.__setattr__(self, "scan", frozen(np.reshape(self.scan, (-1, 3))))
        object.__setattr__(self, "sigma_m", frozen(self.sigma_m))
        counts = {len(self.names), len(self.groups), len(self.sfm), len(self.scan), len(self.sigma_m)}
        if len(counts) != 1:
            raise GeometryError(f"Keypoint pairs need columns of one length, got {sorted(counts)}.")
        finite = np.isfinite(self.sfm).all(axis=1) & np.isfinite(self.scan).all(axis=1)
        if not finite.all():
            name = self.names[int(np.flatnonzero(~finite)[0])]
            raise GeometryError(f"The keypoint {name!r} has a coordinate that is not finite; delete or click it again.")
        if not (np.isfinite(self.sigma_m) & (self.sigma_m > 0)).all():
            raise GeometryError("The expected error of every keypoint must be a number of metres above 0.")

    def __len__(self) -> int:
        return len(self.names)

    @cached_property
    def group_names(self) -> tuple[str, ...]:
        """The G different groups, in order of appearance."""
        return tuple(dict.fromkeys(self.groups))

    @cached_property
    def group_index(self) -> Ints:
        """(K,) the position of each pair's group in `group_names`."""
        position = {name: i for i, name in enumerate(self.group_names)}
        return frozen([position[group] for group in self.groups], np.int64)

    @cached_property
    def weights(self) -> Floats:
        """(K,) weights for least squares: a group counts as one observation, however many corners it has."""
        size = np.bincount(self.group_index, minlength=len(self.group_names))
        return frozen(1 / (self.sigma_m**2 * size[self.group_index])) if len(self) else frozen(np.zeros(0))

    def take(self, mask: Bools | Ints) -> Correspondences:
        """Some of the pairs, by mask (K,) or by indices."""
        indices = np.arange(len(self))[mask]
        return Correspondences(
            tuple(self.names[i] for i in indices),
            tuple(self.groups[i] for i in indices),
            self.sfm[indices],
            self.scan[indices],
            self.sigma_m[indices],
        )

    def of_group(self, group: int) -> Bools:
        """(K,) which pairs belong to the group at this position."""
        return np.asarray(self.group_index == group)


def gather(scan_tags: TagCorners | None, sfm_tags: TagCorners | None, keypoints: KeypointSet) -> Correspondences:
    """The pairs of all tags that both sides know, by id, and of all clicked keypoints that count.

    A tag whose sightings by the phone disagree is expected to be off by as much, beside `TAG_SIGMA_M`; so is a keypoint
    of which one side or both were triangulated from clicks in frames, beside `CLICKED_SIGMA_M`.
    """
    names: list[str] = []
    groups: list[str] = []
    sfm: list[Floats] = []
    scan: list[Floats] = []
    sigmas: list[float] = []
    if scan_tags is not None and sfm_tags is not None:
        row_in_sfm = {int(tag): row for row, tag in enumerate(sfm_tags.tag_id)}
        for row, tag in enumerate(scan_tags.tag_id):
            if int(tag) in row_in_sfm:
                names += [f"tag {tag} corner {corner}" for corner in range(4)]
                groups += [f"tag {tag}"] * 4
                scan.append(scan_tags.corners[row])
                sfm.append(sfm_tags.corners[row_in_sfm[int(tag)]])
                sigmas += [float(np.hypot(TAG_SIGMA_M, np.nan_to_num(scan_tags.spread[row])))] * 4
    clicked, clicked_scan, clicked_sfm = keypoints.counting()
    counting = [pair for pair in keypoints if pair.counts]
    sfm_side, scan_side = np.concatenate([*sfm, clicked_sfm]), np.concatenate([*scan, clicked_scan])
    scale = rough_scale(sfm_side, scan_side)
    sigmas += [
        float(np.linalg.norm([CLICKED_SIGMA_M, pair.scan_sigma or 0.0, scale * (pair.sfm_sigma or 0.0)]))
        for pair in counting
    ]
    return Correspondences(
        (*names, *clicked), (*groups, *(pair.key for pair in counting)), sfm_side, scan_side, np.array(sigmas)
    )


def rough_scale(sfm: Floats, scan: Floats) -> float:
    """Metres per unit of the reconstruction: the median ratio of the distances between pairs (K, 3); 1 for K < 2.

    Of many pairs some, evenly, say it well enough: a list from a file may have thousands.
    """
    rows = np.unique(np.linspace(0, len(sfm) - 1, min(len(sfm), _ROUGH_PAIRS)).astype(np.int64))
    sfm, scan = sfm[rows], scan[rows]
    first, second = np.triu_indices(len(sfm), 1)
    apart = np.linalg.norm(sfm[first] - sfm[second], axis=1)
    ratios = np.linalg.norm(scan[first] - scan[second], axis=1)[apart > 0] / apart[apart > 0]
    return float(np.median(ratios)) if len(ratios) else 1.0
