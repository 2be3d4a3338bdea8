"""A phone's lidar: depth of 256x192 with noise that grows with distance, soft edges, holes, and confidence 0 to 2."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform

from gazeloc_core.arrays import Bytes, Floats
from gazeloc_core.camera import Camera
from gazeloc_core.synthesis.renderer import Rays, Renderer

SIZE = (256, 192)
SPARSE = 4
"""The sensor's own dots are this many pixels apart; Apple fills in between."""


def measured(
    renderer: Renderer,
    phone_camera: Camera,
    scan_from_camera: RigidTransform,
    is_glass: NDArray[np.bool_],
    rng: np.random.Generator,
) -> tuple[NDArray[np.uint16], Bytes]:
    """Depth in millimetres (0: nothing) and confidence, both (192, 256), from the true pose.

    `is_glass` (F,) says which faces let the lidar through.
    """
    camera = phone_camera.scaled(*SIZE)
    fine = renderer.shoot(Rays(camera), scan_from_camera, colors=False)
    depth = np.where(np.isfinite(fine.depth), fine.depth, 0).astype(np.float32)
    glass = is_glass[fine.face]
    low, high = cv2.erode(depth, np.ones((3, 3))), cv2.dilate(depth, np.ones((3, 3)))
    edge = (high - low) > 0.07 + 0.04 * depth
    # Flying pixels: near edges the measurement mixes what lies before and behind.
    mixed = cv2.GaussianBlur(depth, (0, 0), 1.1)
    share = cv2.GaussianBlur(edge.astype(np.float32), (0, 0), 0.8)
    soft = depth + np.clip(share, 0, 1) * (mixed - depth)
    noisy = soft * (1 + 0.003 * _speckle(rng, SPARSE)) + 0.0004 * _speckle(rng, 1.0) + 0.003 * _speckle(rng, 9.0)
    noisy[glass] += np.abs(1.5 + _speckle(rng, 9.0)[glass])
    confidence = _confidence(depth, edge, glass, camera, _speckle(rng, SPARSE))
    millimetres = np.clip(np.rint(noisy * 1000), 0, 65535).astype(np.uint16)
    millimetres[(depth <= 0) | (noisy > 6.5)] = 0
    return millimetres, confidence


def _speckle(rng: np.random.Generator, size_px: float) -> NDArray[np.float32]:
    """Smooth noise of unit strength with blobs of about that size."""
    raw = rng.normal(size=(SIZE[1], SIZE[0])).astype(np.float32)
    if size_px <= 1:
        return raw
    blurred = cv2.GaussianBlur(raw, (0, 0), size_px / 2)
    return np.asarray(blurred / blurred.std(), dtype=np.float32)


def _confidence(
    depth: NDArray[np.float32],
    edge: NDArray[np.bool_],
    glass: NDArray[np.bool_],
    camera: Camera,
    speckle: NDArray[np.float32],
) -> Bytes:
    """2 where the phone is sure; less at edges, far away and at grazing angles; 0 on glass."""
    grazing = _cosine(depth, camera) < 0.17
    confidence = np.full(depth.shape, 2, dtype=np.uint8)
    confidence[edge | grazing | (depth > 4.4 + 0.35 * speckle)] = 1
    sharpest = cv2.erode(edge.astype(np.uint8), np.ones((2, 2))) > 0
    confidence[sharpest | (depth > 5.4 + 0.3 * speckle) | (depth < 0.2) | glass] = 0
    return confidence


def _cosine(depth: NDArray[np.float32], camera: Camera) -> Floats:
    """The cosine between the ray and the surface's normal at each pixel, from the depth's own slope."""
    rays = Rays(camera).directions.reshape(*depth.shape, 3)
    points = rays / rays[..., 2:] * depth[..., None]
    right, down = np.gradient(points, axis=1), np.gradient(points, axis=0)
    normal = np.cross(right, down)
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-12)
    return np.asarray(np.abs((normal * rays).sum(axis=-1)))
