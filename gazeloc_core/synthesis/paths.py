"""How cameras move through the room: a phone in a scanning hand, glasses on a walking head; and how phones lose track.

Poses are `room_from_camera` (x right, y down, z forward) until the caller moves them into the scan.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.spatial.transform import RigidTransform, Rotation

from gazeloc_core.arrays import Floats
from gazeloc_core.synthesis.routes import ROUTES, RouteName

Aim: TypeAlias = Callable[[Floats, Floats], Floats]
"""The points (T, 3) that are looked at, at times (T,) from places (T, 3)."""


@dataclass(frozen=True, eq=False)
class Path:
    """Where a camera is, keyframes of time `eye_s` (N,) and place `eyes` (N, 3), and where it looks."""

    eye_s: Floats
    eyes: Floats
    aim: Aim
    sway_m: float
    sway_deg: float
    step_hz: float
    """Steps per second of a walker; 0 for a hand."""
    seed: int
    hurry: float = 1.0
    """How many times as fast the path is taken as its own times say."""

    def poses(self, seconds: ArrayLike) -> RigidTransform:
        """`room_from_camera` at times (T,)."""
        t = np.asarray(seconds, dtype=np.float64) * self.hurry
        eye = CubicSpline(self.eye_s, self.eyes, bc_type="natural")(t)
        speed = np.linalg.norm(CubicSpline(self.eye_s, self.eyes, bc_type="natural")(t, 1)[:, [0, 2]], axis=1)
        stride = np.clip(speed / 0.6, 0, 1) * (self.step_hz > 0)
        eye[:, 1] += 0.012 * stride * np.sin(2 * np.pi * self.step_hz * t)
        eye = eye + self.sway_m * wander(t, 3, self.seed, 0.7)
        turn = Rotation.from_rotvec(np.radians(self.sway_deg) * wander(t, 3, self.seed + 1, 0.9))
        return RigidTransform.from_components(eye, looking(eye, self.aim(t, eye)) * turn)


def looking(eye: Floats, target: Floats) -> Rotation:
    """`room_from_camera` rotations of level cameras at (N, 3) that look at (N, 3)."""
    forward = target - eye
    forward /= np.linalg.norm(forward, axis=1, keepdims=True)
    right = np.cross(forward, (0.0, 1.0, 0.0))
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    return Rotation.from_matrix(np.stack([right, np.cross(forward, right), forward], axis=-1))


def wander(t: Floats, dimensions: int, seed: int, fastest_hz: float) -> Floats:
    """Smooth random motion (T, dimensions) of unit strength (RMS over all dimensions about 1): a sum of slow sines."""
    rng = np.random.default_rng(seed)
    total = np.zeros((len(t), dimensions))
    waves = 9
    for k in range(waves):
        frequency = fastest_hz * (k + 1) / waves * rng.uniform(0.8, 1.2, dimensions)
        total += np.sin(2 * np.pi * frequency * t[:, None] + rng.uniform(0, 2 * np.pi, dimensions)) / (k + 1) ** 0.5
    strength = np.sqrt(0.5 * dimensions * (1 / np.arange(1, waves + 1)).sum())
    return np.asarray(total / strength)


@dataclass(frozen=True, eq=False)
class Drift:
    """How reported phone poses differ from the true ones: `offset_m` (N, 3) and `rotvec_rad` (N, 3), mean zero."""

    offset_m: Floats
    rotvec_rad: Floats

    def reported(self, scan_from_camera: RigidTransform) -> RigidTransform:
        """The poses that the phone writes for the true ones."""
        turn = Rotation.from_rotvec(self.rotvec_rad)
        return RigidTransform.from_components(
            scan_from_camera.translation + self.offset_m, turn * scan_from_camera.rotation
        )


def drift(seconds: Floats, rms_m: float, rms_deg: float, seed: int) -> Drift:
    """Slow drift of exactly that RMS (over the length of the vector) and mean zero over the frames at `seconds`."""

    def scaled(values: Floats, rms: float) -> Floats:
        values = values - values.mean(axis=0)
        size = np.sqrt((values**2).sum(axis=1).mean())
        return np.asarray(values * (rms / max(size, 1e-12)))

    return Drift(
        scaled(wander(seconds, 3, seed, 0.09), rms_m),
        scaled(wander(seconds, 3, seed + 1, 0.09), float(np.radians(rms_deg))),
    )


def phone_path(seconds: float, seed: int) -> Path:
    """Two turns about the middle of the room: one that looks outwards, one that looks across and down."""
    turn = np.linspace(0, 4 * np.pi, 41)
    start = np.radians(200)
    a = start + turn
    inner = np.clip((turn - 1.85 * np.pi) / (0.3 * np.pi), 0, 1)
    out = np.column_stack([np.cos(a), np.zeros_like(a), np.sin(a)])
    eye = np.array([0.25, 0.0, 0.08]) + out * np.array([0.75, 0, 0.5]) * (1 + 0.62 * inner)[:, None]
    eye[:, 1] = 1.5 + 0.1 * np.sin(turn * 1.3) - 0.05 * inner
    away = np.array([0.25, 0.0, 0.08]) + out * np.array([3.2, 0, 2.6])
    away[:, 1] = 0.98 + 0.22 * np.sin(turn * 2.5)
    across = np.array([0.1, 0.0, 0.0]) - out * np.array([1.6, 0, 1.3])
    across[:, 1] = 0.36 + 0.36 * np.sin(turn * 2.6 + 1)
    # Between the two turns the phone swings from outwards to across along the wall, never through its own axis.
    swing = inner * np.pi
    side = np.column_stack([-np.sin(a), np.zeros_like(a), np.cos(a)]) * np.sin(swing)[:, None] * 2.5
    look = away * (1 - inner)[:, None] + across * inner[:, None] + side
    t = turn / (4 * np.pi) * seconds
    follow = PchipInterpolator(t, look)
    return Path(t, eye, lambda seconds, _: np.asarray(follow(seconds)), 0.012, 0.9, 0.0, seed)


def glances(looks: Floats, t: Floats, eye: Floats) -> Floats:
    """What a person looks at who rests on each of `looks` (see `Route`) and turns the short way round to the next.

    Directions are blended, not points: a point half-way between two things may lie behind the eye.
    """
    i = np.clip(np.searchsorted(looks[:, 0], t, side="right") - 1, 0, len(looks) - 2)
    s = np.clip((t - looks[i, 1]) / (looks[i + 1, 0] - looks[i, 1]), 0, 1)
    s = s * s * (3 - 2 * s)
    (yaw, pitch), (next_yaw, next_pitch) = _angles(looks[i, 2:] - eye), _angles(looks[i + 1, 2:] - eye)
    yaw = yaw + s * (np.mod(next_yaw - yaw + np.pi, 2 * np.pi) - np.pi)
    pitch = pitch + s * (next_pitch - pitch)
    way = np.column_stack([np.sin(yaw) * np.cos(pitch), np.sin(pitch), np.cos(yaw) * np.cos(pitch)])
    return np.asarray(eye + way)


def _angles(way: Floats) -> tuple[Floats, Floats]:
    return np.arctan2(way[:, 0], way[:, 2]), np.arctan2(way[:, 1], np.hypot(way[:, 0], way[:, 2]))


def head_path(seed: int, route: RouteName = "first", hurry: float = 1.0) -> Path:
    """The head of a person who takes a route; one in a hurry does everything `hurry` times as fast."""
    eyes, looks = ROUTES[route].eyes, ROUTES[route].looks
    return Path(eyes[:, 0], eyes[:, 1:], partial(glances, looks), 0.008, 1.1, 1.9, seed, hurry)
