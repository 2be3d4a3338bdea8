"""Triangles and rays handed to Open3D's ray casting (Embree)."""

from __future__ import annotations

from typing import Any

import numpy as np
import open3d as o3d
from numpy.typing import ArrayLike


def tensor(values: Any) -> Any:
    """An Open3D tensor of an array."""
    make: Any = o3d.core.Tensor  # Open3D's stubs know no overload for arrays
    return make(np.ascontiguousarray(values))


def ray_scene(vertices: ArrayLike, faces: ArrayLike) -> Any:
    """The scene of one mesh: vertices (V, 3), faces (F, 3)."""
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(tensor(np.asarray(vertices, dtype=np.float32)), tensor(np.asarray(faces, dtype=np.uint32)))
    return scene


def hidden(scene: Any, origins: ArrayLike, ways: ArrayLike, near: float = 0.0, far: float = 1.0) -> Any:
    """(N,) whether something lies on `origins + t * ways` for t from `near` to `far`."""
    rays = np.concatenate([np.asarray(origins), np.asarray(ways)], axis=1).astype(np.float32)
    return scene.test_occlusions(tensor(rays), near, far).numpy()
