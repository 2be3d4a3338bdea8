"""Errors of a trajectory against the truth, as the paper takes them (section VI-B). Nothing is aligned to the truth."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import RigidTransform

from gazeloc_core.arrays import Floats, Ints, frozen
from gazeloc_core.errors import GeometryError
from gazeloc_core.trajectory import Trajectory
from gazeloc_core.transforms import rotation_angle_rad

MATCH_NS = 1_000_000
"""A frame and a truth pose belong together when their times differ by no more than this."""


@dataclass(frozen=True)
class ErrorSummary:
    """`mean`, `median` and `max` over the registered keyframes; `p95` over all keyframes, unregistered ones infinite.

    Infinity stands for "no value" too: the mean of nothing. JSON has no infinity, there it is null.
    """

    mean: float
    median: float
    p95: float
    max: float

    @classmethod
    def of(cls, errors: Floats) -> ErrorSummary:
        """The summary of errors (K,) of all keyframes, infinite for those that were not registered."""
        finite = errors[np.isfinite(errors)]
        if len(finite) == 0:
            return cls(math.inf, math.inf, math.inf, math.inf)
        return cls(float(finite.mean()), float(np.median(finite)), _percentile_95(errors), float(finite.max()))

    def to_json(self) -> dict[str, float | None]:
        """A JSON object; null means infinite."""
        return {
            name: value if math.isfinite(value) else None
            for name, value in (("mean", self.mean), ("median", self.median), ("p95", self.p95), ("max", self.max))
        }


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Errors of one trajectory against the truth.

    `frames` in the recording, `keyframes` that were to be registered, `registered` of those; `without_truth` keyframes
    have no truth within 1 ms and count in no error. For the app, of every frame that has a pose and a truth,
    interpolated ones included: `frame_index` (F,), `frame_rotation_deg` (F,), `frame_position_m` (F,).
    """

    frames: int
    keyframes: int
    registered: int
    without_truth: int
    rotation_deg: ErrorSummary
    position_m: ErrorSummary
    frame_index: Ints
    frame_rotation_deg: Floats
    frame_position_m: Floats

    def to_json(self) -> dict[str, Any]:
        """What `gazeloc evaluate --json` prints of one recording and method."""
        return {
            "frames": self.frames,
            "keyframes": self.keyframes,
            "registered": self.registered,
            "without_truth": self.without_truth,
            "rotation_deg": self.rotation_deg.to_json(),
            "position_m": self.position_m.to_json(),
        }


def pose_errors(scan_from_camera: RigidTransform, truth: RigidTransform) -> tuple[Floats, Floats]:
    """Rotation errors in degrees and distances of camera centres in metres, (N,) each, of N paired poses."""
    rotation_deg = np.rad2deg(rotation_angle_rad(truth.rotation, scan_from_camera.rotation))
    position_m = np.linalg.norm(scan_from_camera.translation - truth.translation, axis=-1)
    return np.atleast_1d(rotation_deg), np.atleast_1d(position_m)


def match_times(timestamp_ns: Ints, truth_timestamp_ns: Ints) -> Ints:
    """(N,) the row of the truth nearest in time to each frame, -1 where none is within 1 ms."""
    times, truth = (np.asarray(t, dtype=np.int64) for t in (timestamp_ns, truth_timestamp_ns))
    if len(truth) == 0:
        return np.full(len(times), -1, dtype=np.int64)
    order = np.argsort(truth, kind="stable")
    after = np.clip(np.searchsorted(truth[order], times), 0, len(truth) - 1)
    before = np.maximum(after - 1, 0)
    candidates = order[np.stack([before, after])]
    distance = np.abs(truth[candidates] - times)
    nearest = distance.argmin(axis=0)
    rows = candidates[nearest, np.arange(len(times))]
    return np.where(distance.min(axis=0) <= MATCH_NS, rows, -1)


def evaluate(trajectory: Trajectory, truth_timestamp_ns: Ints, truth_poses: RigidTransform) -> Evaluation:
    """Compare `trajectory` with the true `scan_from_camera` (T,) at times (T,) on the recording's own clock.

    Registered means localised by itself (`registered` or `tag_only`); an interpolated keyframe is not.

    Raises:
        GeometryError: if no frame has a truth within 1 ms: the truth is of another recording or clock.
    """
    rows = match_times(trajectory.timestamp_ns, truth_timestamp_ns)
    if (rows < 0).all():
        raise GeometryError(
            f"None of the {len(trajectory)} frames has a true pose within 1 ms; the truth's times must be the "
            "recording's own, in seconds."
        )
    comparable = np.flatnonzero(trajectory.has_pose & (rows >= 0))
    rotation_deg, position_m = np.zeros(0), np.zeros(0)
    if len(comparable):
        rotation_deg, position_m = pose_errors(trajectory.poses(comparable), truth_poses[rows[comparable]])
    localised = trajectory.is_localised
    counted = trajectory.is_keyframe & (rows >= 0)
    summaries = []
    for errors in (rotation_deg, position_m):
        of_frame = np.full(len(trajectory), math.inf)
        of_frame[comparable] = errors
        of_frame[~localised] = math.inf
        summaries.append(ErrorSummary.of(of_frame[counted]))
    return Evaluation(
        frames=len(trajectory),
        keyframes=int(trajectory.is_keyframe.sum()),
        registered=int((trajectory.is_keyframe & localised).sum()),
        without_truth=int((trajectory.is_keyframe & (rows < 0)).sum()),
        rotation_deg=summaries[0],
        position_m=summaries[1],
        frame_index=frozen(comparable, np.int64),
        frame_rotation_deg=frozen(rotation_deg),
        frame_position_m=frozen(position_m),
    )


def _percentile_95(errors: Floats) -> float:
    """The 95th percentile with linear interpolation; infinite as soon as an infinite value takes part."""
    ordered = np.sort(errors)
    position = 0.95 * (len(ordered) - 1)
    low, share = int(position), position - int(position)
    if share == 0 or low + 1 == len(ordered):
        return float(ordered[low])
    if not np.isfinite(ordered[low + 1]):
        return math.inf
    return float((1 - share) * ordered[low] + share * ordered[low + 1])
