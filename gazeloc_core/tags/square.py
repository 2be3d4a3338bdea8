"""The square that a tag is: in the picture and in space."""

from __future__ import annotations

import cv2
import numpy as np

from gazeloc_core.arrays import Floats

UNIT_SQUARE = np.array([[-0.5, 0.5], [0.5, 0.5], [0.5, -0.5], [-0.5, -0.5]])
"""The corners of a tag of side 1 in its own plane (x right, y down), in the order of `tag_types.py`."""

_HUBER_ROUNDS = 20


def tag_centre_px(corners_px: Floats) -> Floats:
    """The picture (2,) of a tag's centre: where the diagonals of its corners (4, 2) cross, not the corners' mean."""
    a, b, c, d = np.asarray(corners_px, dtype=np.float64)
    along = np.linalg.solve(np.column_stack([c - a, b - d]), b - a)
    return np.asarray(a + along[0] * (c - a))


def inside_of_tag_px(corners_px: Floats, per_side: int) -> Floats:
    """A grid of pixels (per_side², 2) on a seen tag (4, 2): even on the tag, by its homography, clear of its edges."""
    image_from_tag = cv2.getPerspectiveTransform(UNIT_SQUARE.astype(np.float32), np.asarray(corners_px, np.float32))
    steps = np.linspace(-0.42, 0.42, per_side)
    x, y = np.meshgrid(steps, steps)
    homogeneous = np.column_stack([x.ravel(), y.ravel(), np.ones(per_side**2)]) @ np.asarray(image_from_tag).T
    return np.asarray(homogeneous[:, :2] / homogeneous[:, 2:])


def fit_plane(points: Floats) -> tuple[Floats, Floats, float]:
    """A point (3,), the unit normal (3,) and the RMS distance of the plane through points (N, 3), few outliers allowed.

    Least squares with Huber weights at 1.5 times the median distance.
    """
    weight = np.ones(len(points))
    for _ in range(_HUBER_ROUNDS):
        middle = np.average(points, axis=0, weights=weight)
        normal = np.linalg.svd((points - middle) * np.sqrt(weight)[:, None], full_matrices=False)[2][2]
        distance = np.abs((points - middle) @ normal)
        weight = np.minimum(1.0, np.maximum(1.5 * np.median(distance), 1e-6) / np.maximum(distance, 1e-9))
    rms = float(np.sqrt(np.average(distance**2, weights=weight)))
    return middle, normal, rms


def rotation_of_square(corners: Floats) -> Floats:
    """The rotation (3, 3) from the tag's own axes to those of its corners (4, 3).

    A rigid fit of all four (Umeyama 1991), not one edge taken for an axis.
    """
    ideal = np.column_stack([UNIT_SQUARE, np.zeros(4)])
    u, _, vt = np.linalg.svd((corners - corners.mean(axis=0)).T @ ideal)
    return np.asarray(u @ np.diag([1.0, 1.0, float(np.sign(np.linalg.det(u @ vt)))]) @ vt)


def fit_square(corners: Floats, side: float | None) -> Floats:
    """The square (4, 3) of the given side, or of the best one, nearest to corners (4, 3)."""
    ideal = np.column_stack([UNIT_SQUARE, np.zeros(4)])
    middle = corners.mean(axis=0)
    turned = ideal @ rotation_of_square(corners).T
    scale = side if side is not None else float(((corners - middle) * turned).sum() / (ideal**2).sum())
    return np.asarray(scale * turned + middle)


def side_of(square: Floats) -> float:
    """The side of a square (4, 3)."""
    return float(np.linalg.norm(square[1] - square[0]))
