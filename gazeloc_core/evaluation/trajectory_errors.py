"""Errors of a whole trajectory: percentiles, outliers, and the absolute and relative errors of the SLAM benchmarks.

ATE and RPE as in J. Sturm et al., "A benchmark for the evaluation of RGB-D SLAM systems" (IROS 2012), sections IV-A and
IV-B, with the alignment of S. Umeyama (PAMI 1991). Errors after an alignment to the truth say what shape a path has,
not where in the room it is: each carries the alignment in its name, and none of them is the headline.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from gazeloc_core.alignment.similarity_fit import solve_umeyama
from gazeloc_core.arrays import Floats, Ints
from gazeloc_core.errors import GeometryError
from gazeloc_core.times import nearest_rows
from gazeloc_core.transforms import rotation_angle_rad

OUTLIER_POSITION_M = 2.0
OUTLIER_ROTATION_DEG = 90.0
FEWEST_TO_ALIGN = 3
"""Two centres can be turned onto any other two: no error after an alignment is told from fewer than this."""


@dataclass(frozen=True)
class ErrorSummary:
    """`mean`, `median`, `max` over the registered keyframes; `p75`, `p90`, `p95` over all, unregistered ones infinite.

    Infinity stands for "no value" too: the mean of nothing. JSON has no infinity, there it is null.
    """

    mean: float
    median: float
    p75: float
    p90: float
    p95: float
    max: float

    @classmethod
    def of(cls, errors: Floats) -> ErrorSummary:
        """The summary of errors (K,) of all keyframes, infinite for those that were not registered."""
        finite = errors[np.isfinite(errors)]
        if len(finite) == 0:
            return cls(*[math.inf] * 6)
        p75, p90, p95 = (percentile(errors, percent) for percent in (75, 90, 95))
        return cls(float(finite.mean()), float(np.median(finite)), p75, p90, p95, float(finite.max()))

    def to_json(self) -> dict[str, float | None]:
        """A JSON object; null means infinite."""
        return {name: finite_or_none(value) for name, value in asdict(self).items()}


@dataclass(frozen=True)
class Outliers:
    """How many of `frames` compared poses are off by more than 2 m (`position`), 90° (`rotation`) or either (`count`).

    The limits are the paper's (section VII).
    """

    frames: int
    position: int
    rotation: int
    count: int

    @classmethod
    def of(cls, position_m: Floats, rotation_deg: Floats) -> Outliers:
        """The outliers among errors (K,) of poses that exist."""
        far, turned = position_m > OUTLIER_POSITION_M, rotation_deg > OUTLIER_ROTATION_DEG
        return cls(len(position_m), int(far.sum()), int(turned.sum()), int((far | turned).sum()))

    @property
    def share(self) -> float:
        """The share of the compared poses that are outliers; infinite where none were compared."""
        return self.count / self.frames if self.frames else math.inf

    def to_json(self) -> dict[str, float | None]:
        """A JSON object; the share is null where no pose was compared."""
        return {**asdict(self), "share": finite_or_none(self.share)}


@dataclass(frozen=True)
class AbsoluteError:
    """ATE: root mean square distance of camera centres in metres, over `frames` poses.

    `unaligned` as they are; `se3_aligned` after the turn and shift, `sim3_aligned` after the turn, shift and scale that
    fit the estimated centres best to the true ones. Infinite where there are too few poses.
    """

    frames: int
    unaligned: float
    se3_aligned: float
    sim3_aligned: float

    @classmethod
    def of(cls, centers: Floats, true_centers: Floats) -> AbsoluteError:
        """The errors of paired camera centres (K, 3), (K, 3) in metres."""
        count = len(centers)
        if count == 0:
            return cls(0, math.inf, math.inf, math.inf)
        unaligned = _rms(np.linalg.norm(centers - true_centers, axis=1))
        if count < FEWEST_TO_ALIGN:
            return cls(count, unaligned, math.inf, math.inf)
        se3, sim3 = (
            _rms(np.linalg.norm(aligned_centers(centers, true_centers, with_scale=scaled) - true_centers, axis=1))
            for scaled in (False, True)
        )
        return cls(count, unaligned, se3, sim3)

    def to_json(self) -> dict[str, float | None]:
        """A JSON object; null means that there were too few poses."""
        return {name: finite_or_none(value) for name, value in asdict(self).items()}


@dataclass(frozen=True)
class RelativeError:
    """RPE over `pairs` of poses: root mean square and mean of the relative motion's error.

    In metres and degrees; infinite where there is no pair.
    """

    pairs: int
    position_rmse_m: float
    position_mean_m: float
    rotation_rmse_deg: float
    rotation_mean_deg: float

    @classmethod
    def of(cls, poses: RigidTransform, true_poses: RigidTransform, pairs: Ints) -> RelativeError:
        """The errors of the motions from row `pairs[:, 0]` to row `pairs[:, 1]` (M, 2) of paired poses (K,)."""
        if len(pairs) == 0:
            return cls(0, *[math.inf] * 4)
        position_m, rotation_deg = relative_pose_errors(poses, true_poses, pairs)
        return cls(
            len(pairs), _rms(position_m), float(position_m.mean()), _rms(rotation_deg), float(rotation_deg.mean())
        )

    def to_json(self) -> dict[str, float | None]:
        """A JSON object; null means that there was no pair."""
        return {name: finite_or_none(value) for name, value in asdict(self).items()}


def percentile(errors: Floats, percent: float) -> float:
    """The percentile of errors (K,), linear between neighbours; infinite as soon as an infinite error takes part.

    Raises:
        GeometryError: if there are no errors.
    """
    if len(errors) == 0:
        raise GeometryError("There are no errors to take a percentile of; compare at least one frame.")
    ordered = np.sort(errors)
    position = percent / 100 * (len(ordered) - 1)
    low, share = int(position), position - int(position)
    if share == 0 or low + 1 == len(ordered):
        return float(ordered[low])
    if not np.isfinite(ordered[low + 1]):
        return math.inf
    return float((1 - share) * ordered[low] + share * ordered[low + 1])


def aligned_centers(centers: Floats, true_centers: Floats, *, with_scale: bool) -> Floats:
    """Camera centres (K, 3) after the best SE3 or Sim3 onto the true ones (Umeyama, equations 40 to 42)."""
    scale, rotation, translation = solve_umeyama(centers, true_centers, np.ones(len(centers)))
    if not with_scale:  # the best turn does not depend on the scale
        return np.asarray((centers - centers.mean(axis=0)) @ rotation.T + true_centers.mean(axis=0), dtype=np.float64)
    return np.asarray(scale * centers @ rotation.T + translation, dtype=np.float64)


def relative_pose_errors(poses: RigidTransform, true_poses: RigidTransform, pairs: Ints) -> tuple[Floats, Floats]:
    """Errors (M,) in metres and degrees of the motions between the rows `pairs` (M, 2): (Q_i⁻¹ Q_j)⁻¹ (P_i⁻¹ P_j)."""
    moved, truly_moved = (_between(each.rotation, np.asarray(each.translation), pairs) for each in (poses, true_poses))
    # The truth's rotation turns the difference of two motions into their quotient's translation: lengths are equal.
    position_m = np.linalg.norm(moved[1] - truly_moved[1], axis=1)
    return position_m, np.rad2deg(rotation_angle_rad(truly_moved[0], moved[0]))


def pairs_in_order(count: int, step: int = 1) -> Ints:
    """(M, 2) rows `step` apart of `count` poses, every start."""
    first = np.arange(max(count - step, 0), dtype=np.int64)
    return np.stack([first, first + step], axis=1)


def pairs_apart(timestamp_ns: Ints, apart_ns: int, tolerance_ns: int) -> Ints:
    """(M, 2) rows of rising times (K,): each with the row nearest to `apart_ns` later, if that is within tolerance.

    A start for which that moment lies after the last time has no partner.
    """
    times = np.asarray(timestamp_ns, dtype=np.int64)
    first = np.flatnonzero(times + apart_ns <= times.max(initial=0))
    later = nearest_rows(times[first] + apart_ns, times, tolerance_ns)
    return np.stack([first, later], axis=1)[later >= 0]


def finite_or_none(value: float) -> float | None:
    """The value for JSON, which has no infinity."""
    return value if math.isfinite(value) else None


def _between(rotation: Rotation, centers: Floats, pairs: Ints) -> tuple[Rotation, Floats]:
    """The motion from the first to the second pose of each pair, in the first camera: rotations and shifts (M, 3)."""
    first, second = pairs[:, 0], pairs[:, 1]
    back = rotation[first].inv()
    return back * rotation[second], np.einsum("nij,nj->ni", back.as_matrix(), centers[second] - centers[first])


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))
