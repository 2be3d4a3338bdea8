"""Poses of a recording's frames in the scan, from an aligned reconstruction (method `sfm`)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform

from gazeloc_core.arrays import Bools, Ints
from gazeloc_core.errors import GeometryError
from gazeloc_core.sfm_model import PlacedModel
from gazeloc_core.trajectory import PoseStatus, Trajectory
from gazeloc_core.transforms import interpolate_poses


@dataclass(frozen=True, kw_only=True)
class LocalizeSfmOptions:
    """Which frames between registered ones get a pose."""

    max_gap_s: float = 1.0
    """Frames are interpolated between two measured ones no further apart than this, in seconds."""


def localize_sfm(
    timestamp_ns: Ints,
    keyframes: Ints,
    placed: Sequence[PlacedModel],
    options: LocalizeSfmOptions | None = None,
) -> Trajectory:
    """The trajectory of a recording with times (N,) and keyframes at these frame indices.

    `placed` are the pieces of the reconstruction that have a place, largest first; a frame that is in two of them takes
    its pose from the first.

    - `registered`: a piece has an image of this frame (a keyframe or not).
    - `tracked`: none has, but a piece's points were carried there and its pose was measured from them.
    - `interpolated`: neither, but the nearest such frames before and after are of one piece and at most `max_gap_s`
      apart.
    - `none`: all others. A keyframe that the reconstruction was given and could not register, and that was not tracked
      either, is among them: it was tried and failed, which speaks against the motion around it being simple, so it is
      never filled in.

    Raises:
        GeometryError: if a piece's images are not of this recording, or two of one piece are of the same frame.
    """
    options = options or LocalizeSfmOptions()
    times = np.asarray(timestamp_ns, dtype=np.int64)
    is_keyframe = frame_mask(np.asarray(keyframes, dtype=np.int64), len(times), "keyframes")
    status = np.full(len(times), PoseStatus.NONE.value, dtype="U16")
    frames, owner, poses, found_as = _measured(placed, len(times))
    if poses is None:
        return Trajectory.from_poses(times, status, is_keyframe, frames, None)
    status[frames] = found_as
    is_open = (status == PoseStatus.NONE.value) & ~is_keyframe & within_gaps(times, times[frames], options.max_gap_s)
    between = np.flatnonzero(is_open)
    after = np.searchsorted(frames, between)
    between = between[owner[after] == owner[after - 1]]
    status[between] = PoseStatus.INTERPOLATED.value
    wanted = np.sort(np.concatenate([frames, between]))
    seconds = (times - times[0]) / 1e9
    return Trajectory.from_poses(
        times, status, is_keyframe, wanted, interpolate_poses(seconds[frames], poses, seconds[wanted])
    )


def _measured(placed: Sequence[PlacedModel], count: int) -> tuple[Ints, Ints, RigidTransform | None, NDArray[Any]]:
    """The frames that were measured, rising, the piece that each is taken from, their poses (None for no frame) and
    statuses. An image goes before a tracked frame, a larger piece's before a smaller one's."""
    owner = np.full(count, -1, dtype=np.int64)
    status = np.full(count, PoseStatus.NONE.value, dtype="U16")
    frames: list[Ints] = []
    poses: list[RigidTransform] = []
    for found_as, number, known, sfm_from_camera in _found(placed, count):
        is_new = owner[known] < 0
        if is_new.any():
            new = known[is_new]
            frames.append(new)
            owner[new], status[new] = number, found_as.value
            poses.append(placed[number].scan_from_sfm.compose_pose(sfm_from_camera[is_new]))
    if not frames:
        return np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64), None, np.empty(0, dtype="U16")
    joined = np.concatenate(frames)
    order = np.argsort(joined)
    rising = joined[order]
    return rising, owner[rising], RigidTransform.concatenate(poses)[order], status[rising]


def _found(placed: Sequence[PlacedModel], count: int) -> Iterator[tuple[PoseStatus, int, Ints, RigidTransform]]:
    """How they were found, the piece's number, frames (M,) and their M `sfm_from_camera`: all images, then the rest."""
    for number, piece in enumerate(placed):
        images = np.flatnonzero(piece.model.frame_indices >= 0)
        frame_mask(piece.model.frame_indices[images], count, "images of the reconstruction")
        if len(images):
            frames = piece.model.frame_indices[images]
            yield PoseStatus.REGISTERED, number, frames, piece.model.sfm_from_camera[images]
    for number, piece in enumerate(placed):
        tracked = piece.tracked
        if tracked is not None and len(tracked):
            frame_mask(tracked.frame_indices, count, "tracked frames")
            yield PoseStatus.TRACKED, number, tracked.frame_indices, tracked.sfm_from_camera


def within_gaps(at_ns: Ints, known_ns: Ints, max_gap_s: float) -> Bools:
    """(M,) whether each time lies between two neighbours of the rising `known_ns` at most `max_gap_s` apart.

    A time that equals a known one is within; nothing before the first or after the last is.
    """
    if len(known_ns) == 0:
        return np.zeros(len(at_ns), dtype=np.bool_)
    after = np.searchsorted(known_ns, at_ns, side="left")
    inside = after < len(known_ns)
    after = np.minimum(after, len(known_ns) - 1)
    exact = known_ns[after] == at_ns
    before = np.maximum(after - 1, 0)
    short = (after > 0) & (known_ns[after] - known_ns[before] <= max_gap_s * 1e9)
    return np.asarray(inside & (exact | short), dtype=np.bool_)


def frame_mask(indices: Ints, count: int, what: str) -> Bools:
    """(N,) true at these frames of a recording with `count` frames.

    Raises:
        GeometryError: if a frame is not of the recording or named twice; `what` names them in the sentence.
    """
    mask = np.zeros(count, dtype=np.bool_)
    outside = indices[(indices < 0) | (indices >= count)]
    if len(outside):
        raise GeometryError(
            f"The {what} name frame {int(outside[0])}, but the recording has {count} frames; "
            "check that they belong to this recording."
        )
    mask[indices] = True
    if mask.sum() != len(indices):
        twice = int(np.flatnonzero(np.bincount(indices) > 1)[0])
        raise GeometryError(f"The {what} name frame {twice} twice; check how image names were joined to frames.")
    return mask
