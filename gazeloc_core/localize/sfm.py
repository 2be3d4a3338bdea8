"""Poses of a recording's frames in the scan, from an aligned reconstruction (method `sfm`)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gazeloc_core.arrays import Bools, Ints
from gazeloc_core.errors import GeometryError
from gazeloc_core.sfm_model import SfmModel
from gazeloc_core.trajectory import PoseStatus, Trajectory
from gazeloc_core.transforms import Similarity, interpolate_poses


@dataclass(frozen=True, kw_only=True)
class LocalizeSfmOptions:
    """Which frames between registered ones get a pose."""

    max_gap_s: float = 1.0
    """Frames are interpolated between two registered ones no further apart than this, in seconds."""


def localize_sfm(
    timestamp_ns: Ints,
    keyframes: Ints,
    model: SfmModel,
    scan_from_sfm: Similarity,
    options: LocalizeSfmOptions | None = None,
) -> Trajectory:
    """The trajectory of a recording with times (N,) and keyframes at these frame indices.

    - `registered`: the model has an image of this frame (a keyframe or not).
    - `interpolated`: it has none, but the nearest registered frames before and after are at most `max_gap_s` apart.
    - `none`: all others. A keyframe that the reconstruction was given and could not register is among them: it was
      tried and failed, which speaks against the motion around it being simple, so it is never filled in.

    Raises:
        GeometryError: if the model's images are not of this recording, or two of them are of the same frame.
    """
    options = options or LocalizeSfmOptions()
    times = np.asarray(timestamp_ns, dtype=np.int64)
    is_keyframe = frame_mask(np.asarray(keyframes, dtype=np.int64), len(times), "keyframes")
    images = np.flatnonzero(model.frame_indices >= 0)
    images = images[np.argsort(model.frame_indices[images], kind="stable")]
    frames = model.frame_indices[images]
    is_registered = frame_mask(frames, len(times), "images of the reconstruction")
    status = np.full(len(times), PoseStatus.NONE.value, dtype="U16")
    if len(frames) == 0:
        return Trajectory.from_poses(times, status, is_keyframe, frames, None)
    poses = scan_from_sfm.compose_pose(model.sfm_from_camera[images])
    status[frames] = PoseStatus.REGISTERED.value
    between = np.flatnonzero(~is_registered & ~is_keyframe & within_gaps(times, times[frames], options.max_gap_s))
    status[between] = PoseStatus.INTERPOLATED.value
    wanted = np.sort(np.concatenate([frames, between]))
    seconds = (times - times[0]) / 1e9
    return Trajectory.from_poses(
        times, status, is_keyframe, wanted, interpolate_poses(seconds[frames], poses, seconds[wanted])
    )


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
    if len(indices) and (indices.min() < 0 or indices.max() >= count):
        raise GeometryError(
            f"The {what} name frame {int(indices.max())}, but the recording has {count} frames; "
            "check that they belong to this recording."
        )
    mask[indices] = True
    if mask.sum() != len(indices):
        twice = int(np.flatnonzero(np.bincount(indices) > 1)[0])
        raise GeometryError(f"The {what} name frame {twice} twice; check how image names were joined to frames.")
    return mask
