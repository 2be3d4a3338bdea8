"""Surfaces of a made-up room: patches, each a grid of points with a procedural texture laid over it in metres.

Seen from its front a patch has its first row on top and its first column on the left, so a picture painted row by row
hangs the right way round. Room frame: metres, y up, the floor at y = 0.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from gazeloc_core.arrays import Floats, frozen

Paint: TypeAlias = Callable[[Floats, Floats], Floats]
"""Linear albedo (..., 3) at x to the right and y down on the patch, both in metres."""


@dataclass(frozen=True, eq=False)
class Patch:
    """A surface: `grid` (R, C, 3) points, `size_m` its width and height when laid flat, `paint` its albedo."""

    name: str
    grid: Floats
    size_m: tuple[float, float]
    paint: Paint
    texel_m: float = 0.004
    """Distance of texels of its texture."""
    emission: float = 0.0
    """Radiance per albedo of a surface that glows by itself; 0 for one that is lit."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "grid", frozen(self.grid))

    def moved(self, rotation: Rotation, offset: ArrayLike) -> Patch:
        """The patch turned about the origin, then shifted."""
        return replace(self, grid=self.grid @ rotation.as_matrix().T + np.asarray(offset))

    def points(self, u: Floats, v: Floats) -> Floats:
        """Points (..., 3) at fractions `u` to the right and `v` down, bilinear between grid points."""
        rows, columns = self.grid.shape[:2]
        x, y = np.clip(u, 0, 1) * (columns - 1), np.clip(v, 0, 1) * (rows - 1)
        i, j = np.minimum(y.astype(int), rows - 2), np.minimum(x.astype(int), columns - 2)
        a, b = (y - i)[..., None], (x - j)[..., None]
        g = self.grid
        upper = (1 - b) * g[i, j] + b * g[i, j + 1]
        lower = (1 - b) * g[i + 1, j] + b * g[i + 1, j + 1]
        return np.asarray((1 - a) * upper + a * lower)

    def normals(self, u: Floats, v: Floats) -> Floats:
        """Unit normals (..., 3) of the front at fractions `u`, `v`."""
        rows, columns = self.grid.shape[:2]
        du, dv = 0.5 / (columns - 1), 0.5 / (rows - 1)
        right = self.points(u + du, v) - self.points(u - du, v)
        down = self.points(u, v + dv) - self.points(u, v - dv)
        normal = np.cross(down, right)
        return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-12))


def moved(patches: Sequence[Patch], offset: ArrayLike, yaw_deg: float = 0.0) -> list[Patch]:
    """Patches turned about the vertical axis, then shifted."""
    rotation = Rotation.from_euler("y", yaw_deg, degrees=True)
    return [patch.moved(rotation, offset) for patch in patches]


def quad(
    name: str,
    corner: ArrayLike,
    right: ArrayLike,
    down: ArrayLike,
    paint: Paint,
    texel_m: float = 0.004,
    emission: float = 0.0,
) -> Patch:
    """A parallelogram from its upper left corner, seen from its front."""
    c, r, d = (np.asarray(v, dtype=np.float64) for v in (corner, right, down))
    grid = np.array([[c, c + r], [c + d, c + d + r]])
    size = (float(np.linalg.norm(r)), float(np.linalg.norm(d)))
    return Patch(name, grid, size, paint, texel_m, emission)


def box(
    name: str,
    low: ArrayLike,
    high: ArrayLike,
    paint: Paint,
    top: Paint | None = None,
    front: Paint | None = None,
    texel_m: float = 0.004,
) -> list[Patch]:
    """The six sides of an axis-aligned box; `front` is the side that looks along +z."""
    (x0, y0, z0), (x1, y1, z1) = (np.asarray(v, dtype=np.float64) for v in (low, high))
    w, h, d = x1 - x0, y1 - y0, z1 - z0
    sides = [
        ("front", (x0, y1, z1), (w, 0, 0), (0, -h, 0), front or paint),
        ("back", (x1, y1, z0), (-w, 0, 0), (0, -h, 0), paint),
        ("left", (x0, y1, z0), (0, 0, d), (0, -h, 0), paint),
        ("right", (x1, y1, z1), (0, 0, -d), (0, -h, 0), paint),
        ("top", (x0, y1, z0), (w, 0, 0), (0, 0, d), top or paint),
        ("bottom", (x0, y0, z1), (w, 0, 0), (0, 0, -d), paint),
    ]
    return [quad(f"{name}.{side}", c, r, down, p, texel_m) for side, c, r, down, p in sides]


def lathe(
    name: str,
    profile: Sequence[tuple[float, float]],
    paint: Paint,
    segments: int = 28,
    texel_m: float = 0.004,
    emission: float = 0.0,
) -> Patch:
    """A surface of revolution about the y axis; `profile` holds (radius, height) from top to bottom."""
    radius, height = np.array(profile, dtype=np.float64).T
    angle = np.linspace(0, 2 * np.pi, segments + 1)
    grid = np.empty((len(radius), len(angle), 3))
    grid[..., 0], grid[..., 2] = radius[:, None] * np.sin(angle), radius[:, None] * np.cos(angle)
    grid[..., 1] = height[:, None]
    length = float(np.hypot(np.diff(radius), np.diff(height)).sum())
    return Patch(name, grid, (2 * np.pi * float(radius.max()), length), paint, texel_m, emission)


def disc(name: str, radius: float, height: float, paint: Paint, texel_m: float = 0.004) -> Patch:
    """A horizontal disc that looks up."""
    flat = lathe(name, [(1e-3, height), (radius, height)], paint, texel_m=texel_m)
    return replace(flat, size_m=(2 * np.pi * radius, radius))


def pillow(name: str, size: ArrayLike, paint: Paint, roundness: float = 0.45, texel_m: float = 0.004) -> Patch:
    """A soft block about the origin: a superellipsoid; `roundness` 1 is an ellipsoid, near 0 a box."""
    a, b, c = np.asarray(size, dtype=np.float64) / 2
    latitude, longitude = np.linspace(np.pi / 2, -np.pi / 2, 20)[:, None], np.linspace(0, 2 * np.pi, 33)

    def power(values: Floats) -> Floats:
        return np.asarray(np.sign(values) * np.abs(values) ** roundness)

    grid = np.empty((20, 33, 3))
    grid[..., 0] = a * power(np.cos(latitude)) * power(np.sin(longitude))
    grid[..., 1] = b * power(np.sin(latitude))
    grid[..., 2] = c * power(np.cos(latitude)) * power(np.cos(longitude))
    return Patch(name, grid, (2 * (2 * a + 2 * c) * 0.9, 2 * b + a + c), paint, texel_m)


def leaf(name: str, length: float, width: float, droop: float, paint: Paint) -> Patch:
    """A bent leaf that grows from the origin along +z and up, then droops."""
    along, across = np.linspace(0, 1, 9), np.linspace(-1, 1, 5)
    half = width / 2 * np.sin(np.pi * np.clip(along * 0.94 + 0.05, 0, 1)) ** 0.8
    grid = np.empty((9, 5, 3))
    grid[..., 0] = half[:, None] * across
    grid[..., 1] = (length * (0.75 * along - droop * along**2))[:, None] - 0.15 * half[:, None] * across**2 * 2
    grid[..., 2] = (length * (0.85 * along))[:, None]
    return Patch(name, grid, (width, length), paint, 0.003)
