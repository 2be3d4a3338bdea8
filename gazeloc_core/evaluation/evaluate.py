"""Errors of a trajectory against the truth, as the paper takes them (section VI-B).

Nothing is aligned to the truth for them; what is, beside the headline, says so in its name (`trajectory_errors`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform

from gazeloc_core.arrays import Floats, Ints, frozen
from gazeloc_core.errors import GeometryError
from gazeloc_core.evaluation.trajectory_errors import (
    AbsoluteError,
    ErrorSummary,
    Outliers,
    RelativeError,
    pairs_apart,
    pairs_in_order,
)
from gazeloc_core.frames.marks import FrameMarks, Mark
from gazeloc_core.times import nearest_rows
from gazeloc_core.trajectory import PoseStatus, Trajectory
from gazeloc_core.transforms import rotation_angle_rad

MATCH_NS = 1_000_000
"""A frame and a truth pose belong together when their times differ by no more than this."""
APART_NS, APART_TOLERANCE_NS = 1_000_000_000, 250_000_000
"""RPE over a second: between keyframes whose times differ by a second, give or take half of a keyframe's slot."""


@dataclass(frozen=True)
class StatusErrors:
    """Errors of the `frames` of one status or mark, keyframes or not, that have a pose and a truth."""

    frames: int
    rotation_deg: ErrorSummary
    position_m: ErrorSummary

    def to_json(self) -> dict[str, Any]:
        """A JSON object."""
        return {
            "frames": self.frames,
            "rotation_deg": self.rotation_deg.to_json(),
            "position_m": self.position_m.to_json(),
        }


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Errors of one trajectory against the truth.

    `frames` in the recording, `keyframes` that were to be registered, `registered` of those; `without_truth` keyframes
    have no truth within 1 ms and count in no error. `left_out` frames that people marked bad are as if they were not
    there, but for `frames` and `by_mark`. `outliers`, `ate_m` and the relative errors `rpe_in_order` (from
    each registered keyframe to the next) and `rpe_per_second` (to the one a second later) are over the registered
    keyframes that have a truth. `by_status` has the errors of all frames, keyframes or not, by how they came by their
    pose, `by_mark` those that people marked. For the app, of every frame that has a pose and a truth, interpolated ones
    included: `frame_index` (F,), `frame_rotation_deg` (F,), `frame_position_m` (F,).
    """

    frames: int
    keyframes: int
    registered: int
    without_truth: int
    rotation_deg: ErrorSummary
    position_m: ErrorSummary
    outliers: Outliers
    ate_m: AbsoluteError
    rpe_in_order: RelativeError
    rpe_per_second: RelativeError
    by_status: Mapping[PoseStatus, StatusErrors]
    by_mark: Mapping[Mark, StatusErrors]
    left_out: int
    frame_index: Ints
    frame_rotation_deg: Floats
    frame_position_m: Floats

    def to_json(self) -> dict[str, Any]:
        """What `gazeloc evaluate --json` prints of one recording and method: metres and degrees, null for infinite.

        Keys are added, never renamed or removed. `rotation_deg`, `position_m`: see `ErrorSummary`. `outliers`: see
        `Outliers`, of all compared `frames` those off by more than 2 m or 90°. `ate_m`: root mean squares of the
        position, `unaligned` and after each alignment. `rpe`: `in_order` and `per_second`, see `RelativeError`.
        `by_status`: of all frames of each status that has any with a pose and a truth; `by_mark`: of those that people
        marked good, bad or unsure, left out or not.
        """
        return {
            "frames": self.frames,
            "keyframes": self.keyframes,
            "registered": self.registered,
            "without_truth": self.without_truth,
            "rotation_deg": self.rotation_deg.to_json(),
            "position_m": self.position_m.to_json(),
            "outliers": self.outliers.to_json(),
            "ate_m": self.ate_m.to_json(),
            "rpe": {"in_order": self.rpe_in_order.to_json(), "per_second": self.rpe_per_second.to_json()},
            "by_status": {status.value: errors.to_json() for status, errors in self.by_status.items()},
            "by_mark": {mark.value: errors.to_json() for mark, errors in self.by_mark.items()},
            "left_out": self.left_out,
        }


def pose_errors(scan_from_camera: RigidTransform, truth: RigidTransform) -> tuple[Floats, Floats]:
    """Rotation errors in degrees and distances of camera centres in metres, (N,) each, of N paired poses."""
    rotation_deg = np.rad2deg(rotation_angle_rad(truth.rotation, scan_from_camera.rotation))
    position_m = np.linalg.norm(scan_from_camera.translation - truth.translation, axis=-1)
    return np.atleast_1d(rotation_deg), np.atleast_1d(position_m)


def match_times(timestamp_ns: Ints, truth_timestamp_ns: Ints) -> Ints:
    """(N,) the row of the truth nearest in time to each frame, -1 where none is within 1 ms."""
    truth = np.asarray(truth_timestamp_ns, dtype=np.int64)
    order = np.argsort(truth, kind="stable")
    rows = nearest_rows(timestamp_ns, truth[order], MATCH_NS)
    return np.where(rows >= 0, order[rows] if len(order) else -1, -1)


def evaluate(
    trajectory: Trajectory,
    truth_timestamp_ns: Ints,
    truth_poses: RigidTransform,
    marks: FrameMarks | None = None,
    *,
    without_bad: bool = False,
) -> Evaluation:
    """Compare `trajectory` with the true `scan_from_camera` (T,) at times (T,) on the recording's own clock.

    `without_bad` leaves out the frames that `marks` says are bad.

    Registered means localised by itself (`registered`, `tracked` or `tag_only`); an interpolated keyframe is not.

    Raises:
        GeometryError: if no frame has a truth within 1 ms: the truth is of another recording or clock.
    """
    rows = match_times(trajectory.timestamp_ns, truth_timestamp_ns)
    if (rows < 0).all():
        raise GeometryError(
            f"None of the {len(trajectory)} frames has a true pose within 1 ms; the truth's times must be the "
            "recording's own, in seconds."
        )
    with_both = np.flatnonzero(trajectory.has_pose & (rows >= 0))
    rotation_deg, position_m = np.full(len(trajectory), math.inf), np.full(len(trajectory), math.inf)
    if len(with_both):
        found = pose_errors(trajectory.poses(with_both), truth_poses[rows[with_both]])
        rotation_deg[with_both], position_m[with_both] = found
    marks = marks or FrameMarks()
    is_in = ~marks.have(Mark.BAD, len(trajectory)) if without_bad else np.ones(len(trajectory), np.bool_)
    localised, is_keyframe = trajectory.is_localised, trajectory.is_keyframe & is_in
    comparable = with_both[is_in[with_both]]
    counted = is_keyframe & (rows >= 0)
    judged = np.flatnonzero(counted & localised)
    ate_m, in_order, per_second = _path_errors(trajectory, judged, truth_poses[rows[judged]])
    return Evaluation(
        frames=len(trajectory),
        keyframes=int(is_keyframe.sum()),
        registered=int((is_keyframe & localised).sum()),
        without_truth=int((is_keyframe & (rows < 0)).sum()),
        rotation_deg=ErrorSummary.of(np.where(localised, rotation_deg, math.inf)[counted]),
        position_m=ErrorSummary.of(np.where(localised, position_m, math.inf)[counted]),
        outliers=Outliers.of(position_m[judged], rotation_deg[judged]),
        ate_m=ate_m,
        rpe_in_order=in_order,
        rpe_per_second=per_second,
        by_status=_by_status(trajectory.status[comparable], rotation_deg[comparable], position_m[comparable]),
        by_mark=errors_by_mark(marks, rotation_deg, position_m),
        left_out=int((~is_in).sum()),
        frame_index=frozen(comparable, np.int64),
        frame_rotation_deg=frozen(rotation_deg[comparable]),
        frame_position_m=frozen(position_m[comparable]),
    )


def errors_by_mark(marks: FrameMarks, rotation_deg: Floats, position_m: Floats) -> dict[Mark, StatusErrors]:
    """The errors (N,) of all frames, not finite where one has none, of those that people marked, by mark."""
    found, is_known = {}, np.isfinite(position_m)
    for mark in Mark:
        of_mark = marks.have(mark, len(position_m)) & is_known
        if of_mark.any():
            summaries = (ErrorSummary.of(errors[of_mark]) for errors in (rotation_deg, position_m))
            found[mark] = StatusErrors(int(of_mark.sum()), *summaries)
    return found


def _by_status(status: NDArray[Any], rotation_deg: Floats, position_m: Floats) -> dict[PoseStatus, StatusErrors]:
    """The errors (F,) of compared frames with these statuses (F,), by status."""
    found = {}
    for one in PoseStatus:
        of_status = status == one.value
        if of_status.any():
            summaries = (ErrorSummary.of(errors[of_status]) for errors in (rotation_deg, position_m))
            found[one] = StatusErrors(int(of_status.sum()), *summaries)
    return found


def _path_errors(
    trajectory: Trajectory, judged: Ints, truth: RigidTransform
) -> tuple[AbsoluteError, RelativeError, RelativeError]:
    """ATE, and RPE in order and per second, of the frames `judged` (K,) against their true poses (K,)."""
    poses = trajectory.poses(judged)
    ate_m = AbsoluteError.of(np.asarray(poses.translation), np.asarray(truth.translation))
    apart = pairs_apart(trajectory.timestamp_ns[judged], APART_NS, APART_TOLERANCE_NS)
    in_order, per_second = (RelativeError.of(poses, truth, pairs) for pairs in (pairs_in_order(len(judged)), apart))
    return ate_m, in_order, per_second
