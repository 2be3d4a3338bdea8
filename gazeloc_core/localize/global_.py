"""Method `global`: two surfaces registered by their shape alone, the baseline that the paper argues against (VI-A).

Steps, with the paper's numbers: 1 points sampled on both surfaces; 2 both clouds moved and scaled into [-1, 1], so
that one set of radii suits every room; 3 thinned by voxels, normals, FPFH features, RANSAC with scale; 4 the points
scaled by what was found, then point-to-point ICP, which changes no scale. With the scale given (figure 6e) both are
brought to one size beforehand and nothing estimates it.

Two boxes of [-1, 1] around different halves of a room differ in scale, and RANSAC's scale is as coarse as its voxels:
that is what spoils the paper's answer. `refine_scale` therefore appends an ICP that may change the scale, from large
distances to small ones. The answer holds every step, so that each can be measured and drawn.

Nothing here knows what is right: a wrong answer has a fitness too. Judge it by keypoints (`alignment.judge`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from gazeloc_core.arrays import Floats, frozen
from gazeloc_core.errors import GeometryError, InputError
from gazeloc_core.progress import Report, silent
from gazeloc_core.scan import Mesh
from gazeloc_core.surfaces.clouds import icp_point_to_point, ransac_of_features, sample_surface
from gazeloc_core.transforms import Similarity


@dataclass(frozen=True, kw_only=True)
class GlobalOptions:
    """How two clouds are registered. Lengths are of the normalised clouds, which span 2."""

    samples: int = 30_000
    """Points that are sampled on each surface (step 1)."""
    voxel: float = 0.05
    """Features are made of one point per cube of this size; all their radii follow from it (step 3)."""
    ransac_iterations: int = 1_000_000
    """Most sets of three matches that are tried; fewer where 99.9 % certainty is reached before."""
    icp_distance: float = 0.02
    """Points further from the scan than this take no part in ICP (step 4)."""
    icp_iterations: int = 200
    """Most iterations of each ICP."""
    refine_scale: bool = True
    """Append an ICP that changes the scale too; off is the paper's method. Of no effect where the scale is given."""
    scale_distances: tuple[float, ...] = (0.05, 0.02, 0.01, 0.005)
    """Points further from the scan than this take no part in that ICP, one after the other."""
    seed: int = 0
    """Chooses samples and RANSAC's sets."""

    def __post_init__(self) -> None:
        lengths = (self.voxel, self.icp_distance, *self.scale_distances)
        if min(*lengths, self.samples, self.ransac_iterations, self.icp_iterations) <= 0 or self.seed < 0:
            raise InputError(f"The options of method global must be above 0 (the seed may be 0), got {self}.")


@dataclass(frozen=True)
class GlobalStep:
    """The alignment after one step; `fitness` is the share of sfm points that have a partner on the scan, `rms_m` the
    root mean square distance of these. Normalising has no partners: 0 and infinity."""

    name: str
    scan_from_sfm: Similarity
    fitness: float
    rms_m: float


@dataclass(frozen=True, eq=False)
class GlobalRegistration:
    """The answer of method `global`: the clouds it saw, `sfm_points` (N, 3) and `scan_points` (M, 3), each in its own
    frame; how each was normalised; and the alignment after every step (see `step`)."""

    sfm_points: Floats
    scan_points: Floats
    normalised_from_sfm: Similarity
    normalised_from_scan: Similarity
    steps: tuple[GlobalStep, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "sfm_points", frozen(self.sfm_points))
        object.__setattr__(self, "scan_points", frozen(self.scan_points))

    @property
    def scan_from_sfm(self) -> Similarity:
        """The alignment after the last step."""
        return self.steps[-1].scan_from_sfm

    def step(self, name: str) -> GlobalStep | None:
        """A step by its name, None where it was not taken: `normalised` (figure 6c), `ransac`, `icp` (the paper's
        answer: 6d, or 6e with the scale given), `icp with scale`."""
        return next((step for step in self.steps if step.name == name), None)


def align_global(
    sfm_surface: Mesh,
    scan_surface: Mesh,
    options: GlobalOptions | None = None,
    *,
    scale: float | None = None,
    report: Report = silent,
) -> GlobalRegistration:
    """`scan_from_sfm` from the shapes of a reconstruction's surface (`surfaces/meshing.py`) and of the scan.

    `scale` in metres per unit of the reconstruction, where it is known. The same seed gives the same answer.

    Raises:
        InputError: if the scale is not a positive number.
        GeometryError: if a surface has no area, or the shapes do not match at all.
    """
    options = options or GlobalOptions()
    report(0.0, "sampling both surfaces")
    clouds = [sample_surface(surface, options.samples, options.seed) for surface in (sfm_surface, scan_surface)]
    return register_global(clouds[0], clouds[1], options, scale=scale, report=report)


def register_global(
    sfm_points: Floats,
    scan_points: Floats,
    options: GlobalOptions | None = None,
    *,
    scale: float | None = None,
    report: Report = silent,
) -> GlobalRegistration:
    """`align_global` from step 2 on, for two clouds (N, 3) and (M, 3) without any order in common.

    Raises:
        InputError: if the scale is not a positive number, or a cloud is not of finite points (N, 3) that lie apart.
        GeometryError: if the shapes do not match at all.
    """
    options = options or GlobalOptions()
    if scale is not None and not (np.isfinite(scale) and scale > 0):
        raise InputError(f"The scale of the reconstruction is {scale}; give metres per unit, above 0.")
    sfm, scan = (_checked(points, side) for points, side in ((sfm_points, "reconstruction"), (scan_points, "scan")))
    to_scan, to_sfm = _normaliser(scan), _normaliser(sfm)
    if scale is not None:  # one size on both sides: the scan's
        to_sfm = _normaliser(sfm, to_scan.scale * scale)
    steps = [GlobalStep("normalised", to_scan.inverse() * to_sfm, 0.0, float("inf"))]
    report(0.2, "matching features")
    found = ransac_of_features(
        to_sfm.apply(sfm),
        to_scan.apply(scan),
        voxel=options.voxel,
        with_scale=scale is None,
        iterations=options.ransac_iterations,
        seed=options.seed,
    )
    if found is None:
        raise GeometryError(
            "No part of the reconstruction has the shape of a part of the scan; use tags or keypoints, or check that "
            "both show the same room."
        )
    start = to_scan.inverse() * found.a_from_b * to_sfm
    steps.append(GlobalStep("ransac", start, found.fitness, found.rms / to_scan.scale))
    report(0.6, "ICP")
    passes = [("icp", options.icp_distance, False)]
    if options.refine_scale and scale is None:
        passes += [("icp with scale", distance, True) for distance in options.scale_distances]
    for name, distance, with_scale in passes:
        step = _icp(name, sfm, scan, steps[-1].scan_from_sfm, distance / to_scan.scale, with_scale, options)
        steps = [*(before for before in steps if before.name != name), step]
    report(1.0, f"{100 * steps[-1].fitness:.0f} % of the points lie on the scan")
    return GlobalRegistration(sfm, scan, to_sfm, to_scan, tuple(steps))


def _icp(
    name: str,
    sfm: Floats,
    scan: Floats,
    start: Similarity,
    within_m: float,
    with_scale: bool,
    options: GlobalOptions,
) -> GlobalStep:
    found = icp_point_to_point(
        sfm, scan, start, within=within_m, with_scale=with_scale, iterations=options.icp_iterations
    )
    if found is None:  # nothing is near: ICP has nothing to say, and the start stands with that fitness
        return GlobalStep(name, start, 0.0, float("inf"))
    return GlobalStep(name, found.a_from_b, found.fitness, found.rms)


def _checked(points: Floats, side: str) -> Floats:
    cloud = np.asarray(points, dtype=np.float64)
    if cloud.ndim != 2 or cloud.shape[1] != 3 or len(cloud) < 4:
        raise InputError(f"The cloud of the {side} has the shape {cloud.shape}; give at least four points (N, 3).")
    if not np.isfinite(cloud).all():
        bad = int((~np.isfinite(cloud).all(axis=1)).sum())
        raise InputError(f"The cloud of the {side} has {bad} points that are not finite; remove them.")
    if np.ptp(cloud, axis=0).max() <= 0:
        raise InputError(f"The {len(cloud)} points of the {side} are all at one place; give a cloud with an extent.")
    return cloud


def _normaliser(points: Floats, scale: float | None = None) -> Similarity:
    """Moves the middle of the points' box to the origin and scales its longest side to [-1, 1] (step 2), or as told."""
    low, high = points.min(axis=0), points.max(axis=0)
    factor = 2 / float((high - low).max()) if scale is None else scale
    return Similarity(factor, Rotation.identity(), -factor * (low + high) / 2)
