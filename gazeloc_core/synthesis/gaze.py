"""Where the person looks: fixations on things in the room, quick saccades, blinks, and a tracker's error."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from gazeloc_core.arrays import Bools, Floats, Ints
from gazeloc_core.surfaces.raycast import Raycaster
from gazeloc_core.synthesis.glasses import START_NS, GlassesCapture
from gazeloc_core.synthesis.room import Room

RATE_HZ = 200
SHELL = ("floor", "ceiling", "wall", "window", "skirting")
SACCADE_S = 0.045
WIDEST_DEG = 33.0
BIAS_DEG, JITTER_DEG = 0.75, 0.25
"""The tracker's error: one offset per fixation, and noise of each sample; about 1 degree together."""


@dataclass(frozen=True, eq=False)
class GazeTruth:
    """Per sample (M,): time, measured and true rays in the camera (M, 3), true hits in the scan, fixation, blink."""

    timestamp_ns: Ints
    measured: Floats
    true: Floats
    hit: Floats
    fixation_id: Ints
    blink_id: Ints


def looked(room: Room, capture: GlassesCapture, seed: int) -> GazeTruth:
    """The gaze of the whole recording at 200 Hz."""
    rng = np.random.default_rng(seed)
    last = int(capture.timestamp_ns[-1])
    step = 1_000_000_000 // RATE_HZ
    times = np.arange(START_NS + 1_734_000, last, step) + rng.integers(
        -40_000, 40_000, (last - START_NS - 1_734_000 + step - 1) // step
    )
    poses = capture.poses_at(times)
    caster = Raycaster(room.mesh)
    shell = np.array([p.name.startswith(SHELL) for p in room.patches])[room.patch_of_face]
    rays, fixation = _true_rays(times, poses, caster, shell, rng)
    hits = caster.cast(poses.translation, np.einsum("nij,nj->ni", poses.rotation.as_matrix(), rays))
    bias = rng.normal(0, np.radians(BIAS_DEG) / np.sqrt(2), (int(fixation.max()) + 2, 2))[fixation]
    error = bias + rng.normal(0, np.radians(JITTER_DEG) / np.sqrt(2), (len(times), 2))
    measured = Rotation.from_rotvec(np.column_stack([error, np.zeros(len(times))])).apply(rays)
    blink = _blinks(times, rng)
    return GazeTruth(times, measured, rays, caster.points(hits), fixation, blink)


def _true_rays(
    times: Ints, poses: RigidTransform, caster: Raycaster, shell: Bools, rng: np.random.Generator
) -> tuple[Floats, Ints]:
    """Unit rays in the camera and fixation ids, 0 during saccades."""
    rotations, centers = poses.rotation.as_matrix(), poses.translation
    rays, ids = np.zeros((len(times), 3)), np.zeros(len(times), dtype=np.int64)
    at, number, saccade = 0, 0, int(SACCADE_S * RATE_HZ)
    while at < len(times):
        length = int(rng.uniform(0.22, 0.75) * RATE_HZ)
        middle = min(at + length // 2, len(times) - 1)
        target = _target(rotations[middle], centers[middle], caster, shell, rng)
        span = np.arange(at, min(at + length, len(times)))
        way = np.einsum("nji,nj->ni", rotations[span], target - centers[span])
        way /= np.linalg.norm(way, axis=1, keepdims=True)
        inside = way[:, 2] > np.cos(np.radians(WIDEST_DEG + 4))
        stop = len(span) if inside.all() else max(int(np.argmin(inside)), 1)
        number += 1
        rays[span[:stop]], ids[span[:stop]] = way[:stop], number
        at = int(span[stop - 1]) + 1 + saccade
    gaps = np.flatnonzero(ids == 0)
    known = np.flatnonzero(ids > 0)
    for axis in range(3):
        rays[gaps, axis] = _eased(gaps, known, rays[known, axis])
    return rays / np.linalg.norm(rays, axis=1, keepdims=True), ids


def _eased(gaps: Ints, known: Ints, values: Floats) -> Floats:
    """Values in gaps that leave and arrive softly (minimum jerk, Flash and Hogan 1985)."""
    after = np.clip(np.searchsorted(known, gaps), 1, len(known) - 1)
    start, end = known[after - 1], known[after]
    s = np.clip((gaps - start) / np.maximum(end - start, 1), 0, 1)
    s = s**3 * (10 - 15 * s + 6 * s**2)
    return np.asarray((1 - s) * values[after - 1] + s * values[after])


def _target(rotation: Floats, center: Floats, caster: Raycaster, shell: Bools, rng: np.random.Generator) -> Floats:
    """A point that the person finds worth looking at: on a thing rather than a wall, near the middle of the view."""
    angles = np.clip(rng.normal(0, 11, (12, 2)), -WIDEST_DEG * 0.7, WIDEST_DEG * 0.7)
    ways = Rotation.from_euler("yx", angles, degrees=True).apply([0.0, 0.0, 1.0])
    hits = caster.cast(center, ways @ rotation.T)
    points = caster.points(hits)
    things = np.flatnonzero(hits.is_hit & ~shell[hits.face])
    anything = np.flatnonzero(hits.is_hit)
    return np.asarray(points[things[0] if len(things) else anything[0]])


def _blinks(times: Ints, rng: np.random.Generator) -> Ints:
    """Blink ids (M,), 0 outside of blinks."""
    ids, at, number = np.zeros(len(times), dtype=np.int64), 0, 0
    while True:
        at += int(rng.uniform(2.5, 5.5) * RATE_HZ)
        if at >= len(times):
            return ids
        number += 1
        ids[at : at + int(rng.uniform(0.1, 0.2) * RATE_HZ)] = number
