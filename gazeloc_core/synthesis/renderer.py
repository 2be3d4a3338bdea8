"""Pictures of a made-up room: baked textures in one atlas with mip levels, rays through every pixel of any camera."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform

from gazeloc_core.arrays import Bytes, Floats
from gazeloc_core.camera import Camera
from gazeloc_core.synthesis.embree import tensor
from gazeloc_core.synthesis.geometry import Patch
from gazeloc_core.synthesis.lighting import Lightmap
from gazeloc_core.synthesis.packing import packed

ATLAS_WIDTH = 4096
CELL = 8
"""Texels to which patches are aligned in the atlas, so that three mip levels do not mix them."""
LEVELS = 4
MISS = 0xFFFFFFFF
BAND_ROWS = 48


@dataclass(frozen=True, eq=False)
class Triangles:
    """All patches as triangles: `vertices` (V, 3), `faces` (F, 3); of each face its patch and (F, 3, 2) fractions."""

    vertices: Floats
    faces: NDArray[np.int64]
    patch_of_face: NDArray[np.int64]
    uv_of_corner: Floats


def triangulated(patches: Sequence[Patch]) -> Triangles:
    """The triangles of the patches' grids, wound so that the front is counter-clockwise."""
    vertices, faces, owners, uvs, start = [], [], [], [], 0
    for index, patch in enumerate(patches):
        rows, columns = patch.grid.shape[:2]
        u, v = np.meshgrid(np.linspace(0, 1, columns), np.linspace(0, 1, rows))
        number = np.arange(rows * columns).reshape(rows, columns)
        a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]
        local = np.stack([np.stack([a, d, c], -1), np.stack([a, c, b], -1)], axis=2).reshape(-1, 3)
        vertices.append(patch.grid.reshape(-1, 3))
        faces.append(local + start)
        uvs.append(np.stack([u, v], -1).reshape(-1, 2)[local])
        owners.append(np.full(len(local), index))
        start += rows * columns
    return Triangles(np.concatenate(vertices), np.concatenate(faces), np.concatenate(owners), np.concatenate(uvs))


@dataclass(frozen=True, eq=False)
class Atlas:
    """Radiance of all patches: `levels` of (H, W, 3) float32, each half the one before; where each face lies in it."""

    levels: tuple[NDArray[np.float32], ...]
    xy_of_corner: NDArray[np.float32]
    """(F, 3, 2) texel coordinates in level 0, first texel centre at (0.5, 0.5)."""
    texel_m_of_face: NDArray[np.float32]


def painted(patches: Sequence[Patch], triangles: Triangles, light: Lightmap) -> Atlas:
    """The atlas of all patches: albedo times baked light."""
    sizes = [_texture_size(patch) for patch in patches]
    corners, height = packed(sizes, ATLAS_WIDTH, CELL)
    image = np.zeros((height, ATLAS_WIDTH, 3), dtype=np.float32)
    for patch, (w, h), (x, y), grid in zip(patches, sizes, corners, light.grids, strict=True):
        inner = _patch_radiance(patch, w, h, grid)
        padded = cv2.copyMakeBorder(inner, CELL, CELL, CELL, CELL, cv2.BORDER_REPLICATE)
        image[y - CELL : y + h + CELL, x - CELL : x + w + CELL] = padded
    levels = [image]
    for _ in range(LEVELS - 1):
        rows, columns = levels[-1].shape[:2]
        levels.append(cv2.resize(levels[-1], (columns // 2, rows // 2), interpolation=cv2.INTER_AREA))
    scale = np.array(sizes, dtype=np.float64)[triangles.patch_of_face]
    offset = np.array(corners, dtype=np.float64)[triangles.patch_of_face]
    xy = offset[:, None] + triangles.uv_of_corner * scale[:, None]
    texel = np.array([patch.texel_m for patch in patches])[triangles.patch_of_face]
    return Atlas(tuple(levels), xy.astype(np.float32), texel.astype(np.float32))


def _texture_size(patch: Patch) -> tuple[int, int]:
    width, height = (int(np.clip(np.ceil(s / patch.texel_m / CELL), 1, 200)) * CELL for s in patch.size_m)
    return width, height


def _patch_radiance(patch: Patch, w: int, h: int, irradiance: Floats) -> NDArray[np.float32]:
    x, y = np.meshgrid((np.arange(w) + 0.5) / w * patch.size_m[0], (np.arange(h) + 0.5) / h * patch.size_m[1])
    albedo = patch.paint(x, y)
    if patch.emission:
        return np.asarray(albedo * patch.emission, dtype=np.float32)
    light = cv2.resize(irradiance, (w, h), interpolation=cv2.INTER_LINEAR)
    return np.asarray(albedo * light / np.pi, dtype=np.float32)


class Rays:
    """Rays through all pixels of a camera, `offset_px` away from their centres; made once, used for many poses."""

    def __init__(self, camera: Camera, offset_px: tuple[float, float] = (0.0, 0.0)):
        self.camera = camera
        self.directions = camera.unproject(camera.pixel_centres() + np.array(offset_px)).astype(np.float32)
        focal = float(np.sqrt(camera.focal_px.prod()))
        self.pixel_rad = (self.directions[:, 2] / focal).astype(np.float32)


@dataclass(frozen=True, eq=False)
class Shot:
    """One sharp look: linear `radiance` (h, w, 3), `depth` (h, w) along z in metres (inf for a miss), `face` (h, w)."""

    radiance: NDArray[np.float32]
    depth: NDArray[np.float32]
    face: NDArray[np.int32]


class Renderer:
    """Draws one room."""

    def __init__(self, scene: Any, atlas: Atlas):
        self._scene, self._atlas = scene, atlas
        xy = atlas.xy_of_corner
        first, second = xy[:, 1] - xy[:, 0], xy[:, 2] - xy[:, 0]
        self._of_face = np.column_stack([xy[:, 0], first, second, 1 / atlas.texel_m_of_face]).astype(np.float32)

    def shoot(self, rays: Rays, scan_from_camera: RigidTransform, colors: bool = True, footprint: float = 1.0) -> Shot:
        """One ray per pixel from a pose; without `colors` the radiance is black (depth only).

        `footprint` is the width in pixels for which a ray stands: below 1 where several shots are averaged.
        """
        rotation = scan_from_camera.rotation.as_matrix().astype(np.float32)
        height, width = rays.camera.height, rays.camera.width
        radiance = np.zeros((height, width, 3), dtype=np.float32)
        depth = np.empty((height, width), dtype=np.float32)
        face = np.empty((height, width), dtype=np.int32)
        for top in range(0, height, BAND_ROWS):  # in bands, so that what lies between stays in the cache
            rows = slice(top, min(top + BAND_ROWS, height))
            band = slice(rows.start * width, rows.stop * width)
            bundle = np.empty((band.stop - band.start, 6), dtype=np.float32)
            bundle[:, :3] = scan_from_camera.translation
            np.matmul(rays.directions[band], rotation.T, out=bundle[:, 3:])
            answer = {key: value.numpy() for key, value in self._scene.cast_rays(tensor(bundle)).items()}
            found = answer["primitive_ids"].astype(np.int64).reshape(-1, width)
            missed = found == MISS
            depth[rows] = (answer["t_hit"] * rays.directions[band, 2]).reshape(-1, width)
            face[rows] = np.where(missed, -1, found)
            if colors:
                radiance[rows] = self._shaded(answer, bundle, footprint * rays.pixel_rad[band], width)
                radiance[rows][missed] = 0
        return Shot(radiance, depth, face)

    def _shaded(
        self,
        answer: dict[str, NDArray[Any]],
        bundle: NDArray[np.float32],
        pixel_rad: NDArray[np.float32],
        width: int,
    ) -> NDArray[np.float32]:
        """Radiance (rows, width, 3) at the hits of a band."""
        of_face = np.take(self._of_face, answer["primitive_ids"], axis=0, mode="clip")
        uv = answer["primitive_uvs"]
        xy = of_face[:, :2] + uv[:, :1] * of_face[:, 2:4] + uv[:, 1:] * of_face[:, 4:6]
        cosine = np.abs(np.einsum("ij,ij->i", answer["primitive_normals"], bundle[:, 3:]))
        span = answer["t_hit"] * pixel_rad * of_face[:, 6] / np.sqrt(np.maximum(cosine, np.float32(0.05)))
        places: NDArray[np.float32] = xy.reshape(-1, width, 2).astype(np.float32, copy=False)
        return self._sampled(places, span.reshape(-1, width))

    def _sampled(self, xy: NDArray[np.float32], texels_per_pixel: NDArray[np.float32]) -> NDArray[np.float32]:
        """Bilinear radiance at level-0 texel coordinates, from the mip level that fits each pixel."""
        level = np.zeros(texels_per_pixel.shape, dtype=np.uint8)
        for k in range(1, LEVELS):
            level += texels_per_pixel > 1.57 * 2 ** (k - 1)  # half-way, in the logarithm, between two levels
        result = np.zeros((*xy.shape[:2], 3), dtype=np.float32)
        for k in range(LEVELS):
            here = level == k
            if not here.any():
                continue
            spot = xy / np.float32(2**k) - np.float32(0.5)
            found = cv2.remap(self._atlas.levels[k], spot, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
            np.copyto(result, found, where=here[..., None])
        return result


def developed(radiance: Floats | NDArray[np.float32], exposure: float) -> Bytes:
    """The sRGB picture of linear radiance: exposure, a soft shoulder above 0.65, gamma."""
    steps = np.asarray(radiance, dtype=np.float32) * np.float32(exposure * (CURVE_STEPS / CURVE_TOP))
    return np.asarray(_CURVE[np.clip(steps, 0, CURVE_STEPS - 1).astype(np.uint16)])


def _curve() -> Bytes:
    x = (np.arange(CURVE_STEPS) + 0.5) * CURVE_TOP / CURVE_STEPS
    knee = 0.65
    x = np.where(x > knee, 1 - (1 - knee) * np.exp(-(x - knee) / (1 - knee)), x)
    srgb = np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)
    return np.asarray(np.clip(srgb * 255 + 0.5, 0, 255), dtype=np.uint8)


CURVE_STEPS, CURVE_TOP = 32768, 4.0
_CURVE = _curve()
