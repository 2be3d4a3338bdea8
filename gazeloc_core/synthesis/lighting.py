"""Soft light: irradiance baked into a coarse grid per patch, from a window, lamps, and two bounces between surfaces.

Direct light is sampled on the window's area and at the lamps with shadow rays; what surfaces hand on to each other is
gathered with cosine-weighted rays (Cohen and Wallace, Radiosity and Realistic Image Synthesis, 1993, by Monte Carlo).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gazeloc_core.arrays import Floats
from gazeloc_core.progress import Report
from gazeloc_core.synthesis.embree import hidden, tensor
from gazeloc_core.synthesis.geometry import Patch

BOUNCES = 2
LIFT_M = 0.004


@dataclass(frozen=True)
class AreaLight:
    """A rectangle that shines to its front: `corner`, `right`, `down`, radiance (3,)."""

    corner: tuple[float, float, float]
    right: tuple[float, float, float]
    down: tuple[float, float, float]
    radiance: tuple[float, float, float]


@dataclass(frozen=True)
class Lamp:
    """A glowing ball: centre, radius, radiant intensity (3,); things nearer than `clearance_m` do not shade it."""

    center: tuple[float, float, float]
    radius_m: float
    intensity: tuple[float, float, float]
    clearance_m: float


@dataclass(frozen=True, eq=False)
class Lightmap:
    """Irradiance (rows, columns, 3) per patch."""

    grids: tuple[Floats, ...]


class _Texels:
    """All points at which light is baked, patch after patch."""

    def __init__(self, patches: Sequence[Patch], spacing_m: float):
        self.shapes: list[tuple[int, int]] = []
        points, normals = [], []
        for patch in patches:
            columns, rows = (int(np.clip(np.ceil(s / spacing_m), 2, 160)) for s in patch.size_m)
            u, v = np.meshgrid((np.arange(columns) + 0.5) / columns, (np.arange(rows) + 0.5) / rows)
            self.shapes.append((rows, columns))
            normals.append(patch.normals(u, v).reshape(-1, 3))
            points.append(patch.points(u, v).reshape(-1, 3))
        self.normals = np.concatenate(normals)
        self.points = np.concatenate(points) + LIFT_M * self.normals
        self.start = np.cumsum([0] + [r * c for r, c in self.shapes])

    def split(self, values: Floats) -> list[Floats]:
        return [values[self.start[i] : self.start[i + 1]].reshape(*shape, -1) for i, shape in enumerate(self.shapes)]


def bake(
    patches: Sequence[Patch],
    scene: Any,
    patch_of_face: NDArray[np.int64],
    uv_of_corner: Floats,
    lights: Sequence[AreaLight | Lamp],
    spacing_m: float,
    rays: int,
    seed: int,
    report: Report,
) -> Lightmap:
    """The light on every patch; `uv_of_corner` (F, 3, 2) are fractions within the patch of each face."""
    texels = _Texels(patches, spacing_m)
    rng = np.random.default_rng(seed)
    direct = np.zeros_like(texels.points)
    for light in lights:
        direct += _from_light(light, texels, scene, rays, rng)
    direct = _smoothed(direct, texels)
    report(0.4, "baking light")
    albedo = np.array([_mean_albedo(patch) for patch in patches])
    albedo_of_texel = np.repeat(albedo, np.diff(texels.start), axis=0)
    texel_of_hit = _HitTexels(texels, patch_of_face, uv_of_corner)
    total = direct
    for bounce in range(BOUNCES):
        radiosity = total * albedo_of_texel
        total = direct + _smoothed(_gathered(radiosity, texels, texel_of_hit, scene, rays, rng), texels)
        report(0.4 + 0.3 * (bounce + 1), "baking light")
    return Lightmap(tuple(texels.split(total)))


def _mean_albedo(patch: Patch) -> Floats:
    x, y = np.meshgrid(np.linspace(0, 1, 12), np.linspace(0, 1, 12))
    return np.asarray(patch.paint(x * patch.size_m[0], y * patch.size_m[1]).reshape(-1, 3).mean(axis=0))


def _from_light(
    light: AreaLight | Lamp,
    texels: _Texels,
    scene: Any,
    rays: int,
    rng: np.random.Generator,
) -> Floats:
    """Irradiance (N, 3) of one light with shadows."""
    total = np.zeros((len(texels.points), 3))
    for k in range(rays):
        if isinstance(light, AreaLight):
            side = int(np.sqrt(rays))
            cell = np.array([k % side, k // side % side])
            a, b = ((cell + rng.uniform(0, 1, (len(total), 2))) / side).T[..., None]
            right, down = np.array(light.right), np.array(light.down)
            source = np.array(light.corner) + a * right + b * down
            area = float(np.linalg.norm(np.cross(down, right)))
            facing = np.cross(down, right) / area
        else:
            offset = rng.normal(size=(len(total), 3))
            offset *= light.radius_m / np.linalg.norm(offset, axis=1, keepdims=True)
            source = np.array(light.center) + offset
        way = source - texels.points
        distance = np.linalg.norm(way, axis=1)
        cosine = np.clip((way * texels.normals).sum(axis=1) / distance, 0, None)
        if isinstance(light, AreaLight):
            cosine *= np.clip(-(way @ facing) / distance, 0, None) * area
            color, clear = light.radiance, 0.03
        else:
            color, clear = light.intensity, light.clearance_m
        reach = np.clip(1 - clear / distance, 0.001, 1)[:, None]
        shadow = hidden(scene, texels.points, way * reach)
        total += np.where(shadow, 0, cosine / np.maximum(distance, 0.05) ** 2)[:, None] * np.array(color) / rays
    return total


class _HitTexels:
    """Which texel a ray's hit lies in."""

    def __init__(self, texels: _Texels, patch_of_face: NDArray[np.int64], uv_of_corner: Floats):
        self.shapes = np.array(texels.shapes)
        self.start, self.patch_of_face, self.uv = texels.start, patch_of_face, uv_of_corner

    def find(self, face: NDArray[np.int64], barycentric: Floats) -> NDArray[np.int64]:
        corner = self.uv[face]
        b = barycentric[:, :, None]
        uv = corner[:, 0] + b[:, 0] * (corner[:, 1] - corner[:, 0]) + b[:, 1] * (corner[:, 2] - corner[:, 0])
        patch = self.patch_of_face[face]
        rows, columns = self.shapes[patch].T
        i = np.clip((uv[:, 1] * rows).astype(np.int64), 0, rows - 1)
        j = np.clip((uv[:, 0] * columns).astype(np.int64), 0, columns - 1)
        return np.asarray(self.start[patch] + i * columns + j)


def _gathered(
    radiosity: Floats,
    texels: _Texels,
    hits: _HitTexels,
    scene: Any,
    rays: int,
    rng: np.random.Generator,
) -> Floats:
    """Irradiance (N, 3) that arrives from other surfaces."""
    normals = texels.normals
    helper = np.where(np.abs(normals[:, :1]) > 0.7, [[0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0]])
    side = np.cross(normals, helper)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    other = np.cross(normals, side)
    total = np.zeros((len(normals), 3))
    turn = rng.uniform(0, 2 * np.pi, len(normals))
    for k in range(rays):
        height = (k + rng.uniform(0, 1, len(normals))) / rays
        angle, radius = turn + k * 2.399963, np.sqrt(height)
        way = (np.cos(angle) * radius)[:, None] * side + (np.sin(angle) * radius)[:, None] * other
        way += np.sqrt(1 - height)[:, None] * normals
        ray = np.concatenate([texels.points, way], axis=1).astype(np.float32)
        answer = scene.cast_rays(tensor(ray))
        face = answer["primitive_ids"].numpy().astype(np.int64)
        ok = face < len(hits.patch_of_face)
        found = hits.find(face[ok], answer["primitive_uvs"].numpy()[ok].astype(np.float64))
        total[ok] += radiosity[found] / rays
    return total


def _smoothed(values: Floats, texels: _Texels) -> Floats:
    """The noise of few rays taken out, patch by patch."""
    return np.concatenate(
        [
            cv2.GaussianBlur(grid, (0, 0), 0.8, borderType=cv2.BORDER_REPLICATE).reshape(-1, 3)
            for grid in texels.split(values)
        ]
    )
