"""How good camera poses become with how many keypoints: the paper's figure 8, over many random draws.

The paper shows one set of 4 and one of 10 clicked keypoints. Here each draw chooses keypoints from a pool, moves them
by a clicking error on both sides, aligns by the closed form alone and compares the cameras with the truth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from gazeloc_core.alignment.correspondences import Correspondences, rough_scale
from gazeloc_core.alignment.similarity_fit import solve_umeyama
from gazeloc_core.arrays import Floats, Ints, frozen
from gazeloc_core.errors import GeometryError
from gazeloc_core.transforms import Similarity, rotation_angle_rad

FEWEST = 3


@dataclass(frozen=True, kw_only=True)
class KeypointCountOptions:
    """Which sets of keypoints are drawn, and how badly they are clicked."""

    counts: tuple[int, ...] = (4, 5, 6, 7, 8, 9, 10, 12, 15, 20)
    """Numbers of keypoints that are tried; each at least 3."""
    draws: int = 200
    """Random sets of each number."""
    noise_m: float = 0.01
    """Clicking error per axis on either side, in metres of the scan; 0 where the pairs have errors of their own."""
    far_apart: bool = True
    """Choose keypoints far from each other, as the paper's third rule demands; else any."""
    pool_share: float = 0.5
    """Share of the pool that a draw of far keypoints may choose from, so that draws differ."""
    seed: int = 0
    """Chooses the sets and the errors."""


@dataclass(frozen=True, eq=False)
class KeypointCountErrors:
    """Columns over all draws: `count`, `draw`, and the mean over the cameras of `position_m` and `rotation_deg`."""

    count: Ints
    draw: Ints
    position_m: Floats
    rotation_deg: Floats

    def spread(self, percents: tuple[float, ...] = (10, 50, 90)) -> tuple[Ints, Floats, Floats]:
        """The different counts (C,), and percentiles (C, P) over the draws of each: metres, degrees."""
        counts = np.unique(self.count)
        position_m, rotation_deg = (
            np.array([np.percentile(column[self.count == count], percents) for count in counts])
            for column in (self.position_m, self.rotation_deg)
        )
        return counts, position_m, rotation_deg


def exact_pairs(points_in_sfm: Floats, scan_from_sfm: Similarity) -> Correspondences:
    """A pool without error: points (K, 3) of a reconstruction, and where a known alignment puts them on the scan."""
    names = tuple(f"point {i}" for i in range(len(points_in_sfm)))
    return Correspondences(
        names, names, points_in_sfm, scan_from_sfm.apply(points_in_sfm), np.full(len(points_in_sfm), 0.01)
    )


def keypoint_count_errors(
    pairs: Correspondences,
    sfm_from_camera: RigidTransform,
    scan_from_camera: RigidTransform,
    options: KeypointCountOptions | None = None,
) -> KeypointCountErrors:
    """Errors of the cameras (M,) against their true poses (M,), for each draw of each number of keypoints.

    A group of the pairs is one keypoint, at the mean of its points: of a tag, its centre (the paper, section VI-C).

    Raises:
        GeometryError: if the pool has fewer keypoints than are to be drawn, or fewer than three are to be drawn.
    """
    options = options or KeypointCountOptions()
    sfm, scan = (_keypoints(pairs, side) for side in (pairs.sfm, pairs.scan))
    _check(options, len(sfm))
    rng = np.random.default_rng(options.seed)
    noise_sfm = options.noise_m / rough_scale(sfm, scan)
    columns: list[tuple[Floats, Floats]] = []
    for count in options.counts:
        chosen = np.array([_choose(scan, count, options, rng) for _ in range(options.draws)])
        noise = rng.normal(size=(2, *chosen.shape, 3))
        fits = solve_umeyama(
            sfm[chosen] + noise_sfm * noise[0], scan[chosen] + options.noise_m * noise[1], np.ones(chosen.shape)
        )
        columns.append(_camera_errors(*fits, sfm_from_camera, scan_from_camera))
    return KeypointCountErrors(
        count=frozen(np.repeat(options.counts, options.draws), np.int64),
        draw=frozen(np.tile(np.arange(options.draws), len(options.counts)), np.int64),
        position_m=frozen(np.concatenate([position for position, _ in columns])),
        rotation_deg=frozen(np.concatenate([rotation for _, rotation in columns])),
    )


def _check(options: KeypointCountOptions, available: int) -> None:
    fewest, most = min(options.counts, default=0), max(options.counts, default=0)
    if fewest < FEWEST:
        raise GeometryError(f"An alignment needs at least {FEWEST} keypoints, got {fewest}; choose larger counts.")
    if most > available:
        raise GeometryError(
            f"There are {available} keypoints to choose from, fewer than {most}; give more or choose smaller counts."
        )


def _keypoints(pairs: Correspondences, side: Floats) -> Floats:
    """(G, 3) the mean of each group's points on one side."""
    sums = np.zeros((len(pairs.group_names), 3))
    np.add.at(sums, pairs.group_index, side)
    return sums / np.bincount(pairs.group_index, minlength=len(sums))[:, None]


def _choose(scan: Floats, count: int, options: KeypointCountOptions, rng: np.random.Generator) -> Ints:
    """(count,) indices of the pool (G, 3); far apart: each the farthest from those before, of a random part of it."""
    if not options.far_apart:
        return rng.choice(len(scan), count, replace=False)
    offered = rng.permutation(len(scan))[: max(count, round(options.pool_share * len(scan)))]
    points = scan[offered]
    chosen = [0]
    nearest = np.linalg.norm(points - points[0], axis=1)
    while len(chosen) < count:
        chosen.append(int(nearest.argmax()))
        nearest = np.minimum(nearest, np.linalg.norm(points - points[chosen[-1]], axis=1))
    return np.asarray(offered[chosen], dtype=np.int64)


def _camera_errors(
    scale: Floats, rotation: Floats, shift: Floats, sfm_from_camera: RigidTransform, scan_from_camera: RigidTransform
) -> tuple[Floats, Floats]:
    """Mean errors (D,) in metres and degrees over the cameras (M,) under D similarities."""
    in_sfm, truth = np.asarray(sfm_from_camera.translation), np.asarray(scan_from_camera.translation)
    centers = scale[:, None, None] * np.einsum("dij,mj->dmi", rotation, in_sfm) + shift[:, None]
    position_m = np.linalg.norm(centers - truth, axis=2).mean(axis=1)
    turned = np.einsum("dij,mjk->dmik", rotation, sfm_from_camera.rotation.as_matrix())
    draws, cameras = turned.shape[:2]
    true_rotations = Rotation.from_matrix(np.tile(scan_from_camera.rotation.as_matrix(), (draws, 1, 1)))
    angles = rotation_angle_rad(true_rotations, Rotation.from_matrix(turned.reshape(-1, 3, 3)))
    return position_m, np.rad2deg(angles.reshape(draws, cameras).mean(axis=1))
