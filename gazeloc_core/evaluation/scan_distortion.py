"""Where a scan is off itself, as all frames of a recording see it: a smooth displacement of its places.

Phones drift while they scan: rooms come out bent by a centimetre or two, and then every true pose looks off by as much.
But the scan's errors stay where they are, and each place is seen from many poses. So all frames are explained together:
by a displacement at the nodes of a coarse grid (interpolated between them, alike at neighbours, small), and by a motion
of each camera, most of which are tiny while some may be large. Least squares, the cameras eliminated (Schur
complement), Cauchy's weights on tiles and on cameras: a frame whose pose is wrong is a stray that bends nothing.

A displacement of the whole scan as one, by a similarity, is no distortion but a misalignment of all frames. It is taken
out of the result, so that it counts against every frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gazeloc_core.arrays import Floats, Ints, frozen
from gazeloc_core.evaluation.apparent_motion import TileEquations, robust_scale

_CORNERS = np.array(list(np.ndindex(2, 2, 2)))
_ROUNDS = 8


@dataclass(frozen=True, kw_only=True)
class DistortionOptions:
    """How much a scan may be off, and poses on it."""

    spacing_m: float = 1.0
    """Distance between nodes; doubled until there are no more than `most_nodes`."""
    most_nodes: int = 700
    least_frames: int = 12
    """With fewer frames nothing is told apart."""
    tile_px: float = 0.5
    """Standard deviation of a tile's shift."""
    place_m: float = 0.015
    """Standard deviation of a node's displacement along each axis."""
    step_m: float = 0.01
    """Standard deviation of the difference between neighbouring nodes."""
    good_m: float = 0.005
    """Standard deviation of how far most cameras are off, along each axis; more is a stray's."""
    good_deg: float = 0.2
    """The same of turns."""


@dataclass(frozen=True, eq=False)
class ScanDistortion:
    """Displacements `displacement_m` (K, 3) of the scan at nodes of a grid, scan axes; none far from all of them.

    `cell` (K, 3) are the nodes' whole numbers in a grid of `spacing_m` from `origin` (3,).
    """

    origin: Floats
    spacing_m: float
    cell: Ints
    displacement_m: Floats

    def __post_init__(self) -> None:
        for name in ("origin", "displacement_m"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        object.__setattr__(self, "cell", frozen(self.cell, np.int64))

    @property
    def nodes(self) -> Floats:
        """(K, 3) where the nodes are in the scan."""
        return np.asarray(self.origin + self.spacing_m * self.cell)

    def at(self, places: Floats) -> Floats:
        """How far (N, 3) the scan is off at places (N, 3), interpolated between the nodes of their cells."""
        node, share = self.shares(places)
        return np.asarray(np.einsum("nc,nck->nk", share, self.displacement_m[node]))

    def shares(self, places: Floats) -> tuple[Ints, Floats]:
        """The nodes (N, 8) around places (N, 3) and their shares (N, 8), 0 where a corner has no node."""
        in_grid = (places - self.origin) / self.spacing_m
        low = np.floor(in_grid).astype(np.int64)
        within = (in_grid - low)[:, None, :]
        share = np.where(_CORNERS[None], within, 1 - within).prod(axis=2)
        lowest, size = self.cell.min(axis=0), np.ptp(self.cell, axis=0) + 1
        corner = low[:, None, :] + _CORNERS - lowest
        inside = ((corner >= 0) & (corner < size)).all(axis=2)
        number = np.full(int(size.prod()), -1, dtype=np.int64)
        number[_flat(self.cell - lowest, size)] = np.arange(len(self.cell))
        node = np.where(inside, number[np.where(inside, _flat(corner, size), 0)], -1)
        return np.maximum(node, 0), np.where(node >= 0, share, 0.0)


def scan_distortion(frames: Sequence[TileEquations], options: DistortionOptions | None = None) -> ScanDistortion | None:
    """The distortion that explains the tiles of many frames; None where there are too few frames to tell."""
    options = options or DistortionOptions()
    if len(frames) < options.least_frames:
        return None
    grid = _grid(np.concatenate([frame.place_in_scan for frame in frames]), options)
    sights = [_Sight(frame, grid, options) for frame in frames]
    prior: Floats = _prior(grid, options)
    displacement: Floats = np.zeros(3 * len(grid.cell))
    for _ in range(_ROUNDS):
        normal, right = prior.copy(), np.zeros(len(displacement))
        for sight in sights:
            sight.add_to(normal, right)
        displacement = np.asarray(np.linalg.solve(normal, right))
        for sight in sights:
            sight.weigh(displacement)
    seen = np.zeros(len(grid.cell))
    for sight in sights:
        np.add.at(seen, sight.node, sight.share * sight.weight[:, None])
    return _without_similarity(grid, displacement.reshape(-1, 3), seen)


class _Sight:
    """One frame in the common equations: its tiles' and its camera's weights, and its part of the normal equations."""

    def __init__(self, frame: TileEquations, grid: ScanDistortion, options: DistortionOptions):
        self._frame = frame
        self.node, self.share = grid.shares(frame.place_in_scan)
        self.weight = frame.weight / options.tile_px**2
        self._first_weight, self._camera_weight = self.weight, 1.0
        nodes, place = np.unique(self.node, return_inverse=True)
        by_node = np.zeros((len(frame), len(nodes), 2, 3))
        tile = np.arange(len(frame))
        for corner in range(8):
            column = place.reshape(self.node.shape)[:, corner]
            by_node[tile, column] += self.share[:, corner, None, None] * frame.by_place
        self._by_node = by_node.transpose(0, 2, 1, 3).reshape(2 * len(frame), -1)
        self._columns = (3 * nodes[:, None] + np.arange(3)).ravel()
        self._by_motion, self._shift = frame.by_motion.reshape(-1, 6), frame.shift.ravel()
        good = [np.radians(options.good_deg)] * 3 + [options.good_m] * 3
        self._tightness = np.diag(1 / np.array(good) ** 2)
        self._motion_by_node: Floats = np.zeros((6, 0))
        self._motion: Floats = np.zeros(6)

    def add_to(self, normal: Floats, right: Floats) -> None:
        """Add what the frame says of the nodes, its camera eliminated."""
        weight = np.repeat(self.weight, 2)[:, None]
        weighted = weight * self._by_node
        own = self._by_motion.T @ (weight * self._by_motion) + self._camera_weight * self._tightness
        both, on_motion = self._by_motion.T @ weighted, self._by_motion.T @ (weight[:, 0] * self._shift)
        self._motion_by_node = np.asarray(np.linalg.solve(own, both))
        self._motion = np.asarray(np.linalg.solve(own, on_motion))
        rows = self._columns[:, None]
        normal[rows, self._columns] += self._by_node.T @ weighted - both.T @ self._motion_by_node
        right[self._columns] += weighted.T @ self._shift - both.T @ self._motion

    def weigh(self, displacement: Floats) -> None:
        """Weigh the tiles and the camera by what is left of them with these displacements of all nodes (3 K,)."""
        here = displacement[self._columns]
        motion = self._motion - self._motion_by_node @ here
        left = self._shift - self._by_node @ here - self._by_motion @ motion
        left_px = np.linalg.norm(left.reshape(-1, 2), axis=1)
        self.weight = self._first_weight / (1 + (left_px / robust_scale(left_px)) ** 2)
        self._camera_weight = 1 / (1 + float(motion @ self._tightness @ motion) / 6)


def _grid(places: Floats, options: DistortionOptions) -> ScanDistortion:
    """The nodes around the places (N, 3), without displacement."""
    origin, spacing_m = places.min(axis=0), options.spacing_m
    while True:
        low = np.unique(np.floor((places - origin) / spacing_m).astype(np.int64), axis=0)
        cell = np.unique((low[:, None, :] + _CORNERS).reshape(-1, 3), axis=0)
        if len(cell) <= options.most_nodes:
            return ScanDistortion(origin, spacing_m, cell, np.zeros((len(cell), 3)))
        spacing_m *= 2


def _prior(grid: ScanDistortion, options: DistortionOptions) -> Floats:
    """The normal equations (3 K, 3 K) of small displacements that are alike at neighbouring nodes."""
    laplace = np.zeros((len(grid.cell), len(grid.cell)))
    number = {tuple(cell): k for k, cell in enumerate(grid.cell.tolist())}
    for (x, y, z), k in number.items():
        for beside in ((x + 1, y, z), (x, y + 1, z), (x, y, z + 1)):
            if (other := number.get(beside)) is not None:
                pair = np.ix_((k, other), (k, other))
                laplace[pair] += np.array([[1.0, -1.0], [-1.0, 1.0]])
    per_axis = laplace / options.step_m**2 + np.eye(len(laplace)) / options.place_m**2
    return np.asarray(np.kron(per_axis, np.eye(3)))


def _without_similarity(grid: ScanDistortion, displacement_m: Floats, seen: Floats) -> ScanDistortion:
    """The displacements (K, 3) without the similarity that fits them best; `seen` (K,) is how much each node counts."""
    around = grid.nodes - np.average(grid.nodes, axis=0, weights=seen)
    x, y, z = around.T
    nil, one = np.zeros_like(x), np.ones_like(x)
    columns = [(one, nil, nil), (nil, one, nil), (nil, nil, one), (nil, -z, y), (z, nil, -x), (-y, x, nil), (x, y, z)]
    similar = np.array(columns).transpose(2, 1, 0).reshape(-1, 7)  # (3 K, 7)
    weight = np.repeat(seen, 3)
    normal = similar.T @ (weight[:, None] * similar)
    normal += 1e-9 * np.trace(normal) * np.eye(7)
    part = np.linalg.solve(normal, similar.T @ (weight * displacement_m.ravel()))
    left = displacement_m - (similar @ part).reshape(-1, 3)
    return ScanDistortion(grid.origin, grid.spacing_m, grid.cell, left)


def _flat(cell: NDArray[np.int64], size: NDArray[np.int64]) -> Ints:
    """The number of cells (..., 3) in a block of `size` (3,)."""
    return np.asarray((cell[..., 0] * size[1] + cell[..., 1]) * size[2] + cell[..., 2], dtype=np.int64)
