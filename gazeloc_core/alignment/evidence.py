"""What speaks for and against an alignment, measured at the keypoints.

Three questions are kept apart. How well do the keypoints fit (residual)? How well would a *further* keypoint fit
(leave-one-out: the residual of a group under the alignment fitted to all others)? How far may the alignment be off
where it matters, at the cameras (first-order propagation of the keypoints' errors through the least-squares fit)?
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from gazeloc_core.alignment.correspondences import Correspondences
from gazeloc_core.alignment.left_out import leave_one_out
from gazeloc_core.alignment.similarity_fit import principal_extents, residuals, similarity_jacobian
from gazeloc_core.arrays import Bools, Floats, Ints
from gazeloc_core.sfm_model import SfmModel
from gazeloc_core.transforms import Similarity

Level = Literal["good", "warning", "bad"]


@dataclass(frozen=True)
class Verdict:
    """One judgement in words for people."""

    level: Level
    text: str


@dataclass(frozen=True)
class KeypointEvidence:
    """One pair under the alignment. `leave_one_out_m` is None where the other groups do not determine an alignment,
    or the alignment was not fitted to keypoints; `residual_px` where no registered frame near sees it."""

    name: str
    group: str
    residual_m: float
    residual_px: float | None
    leave_one_out_m: float | None
    is_inlier: bool


@dataclass(frozen=True)
class GeometryEvidence:
    """How well the places of the keypoints determine an alignment.

    `extents_m` are standard deviations along the principal axes, `baseline_m` the largest distance of two keypoints,
    `baseline_of_scene` the same as a share of the reconstructed scene's diagonal (None without a reconstruction).
    Uncertainties are standard deviations: of the rotation, of the scale (relative), and of the camera centres (root
    mean square over the reconstruction's images; None without one).
    """

    extents_m: tuple[float, float, float]
    baseline_m: float
    baseline_of_scene: float | None
    rotation_uncertainty_deg: float
    scale_uncertainty: float
    camera_uncertainty_m: float | None


@dataclass(frozen=True)
class Evidence:
    """Everything that was measured about one alignment, and the verdicts on it.

    `is_fitted`: the alignment was fitted to these keypoints, so their residuals flatter it. `tag_scale` is the size of
    the reconstruction's tags under the alignment divided by the known size, `scan_tag_scale` that of the scan's tags,
    measured without assuming the size.
    """

    keypoints: tuple[KeypointEvidence, ...]
    geometry: GeometryEvidence | None
    is_fitted: bool
    is_contradictory: bool
    tag_scale: float | None
    scan_tag_scale: float | None
    verdicts: tuple[Verdict, ...] = ()

    @property
    def inliers(self) -> tuple[KeypointEvidence, ...]:
        """The keypoints that agree with each other."""
        return tuple(point for point in self.keypoints if point.is_inlier)

    @property
    def residual_rms_m(self) -> float | None:
        """Root mean square residual of the inliers in metres, None without keypoints."""
        return _rms([point.residual_m for point in self.inliers])

    @property
    def leave_one_out_rms_m(self) -> float | None:
        """Root mean square leave-one-out residual of the inliers in metres, None unless every inlier has one."""
        values = [point.leave_one_out_m for point in self.inliers]
        known = [value for value in values if value is not None]
        return _rms(known) if len(known) == len(values) else None

    @property
    def worst_level(self) -> Level:
        """The worst of the verdicts."""
        levels = {verdict.level for verdict in self.verdicts}
        return "bad" if "bad" in levels else "warning" if "warning" in levels else "good"

    def to_json(self) -> dict[str, Any]:
        """A JSON object that `from_json` reads."""
        geometry = None if self.geometry is None else dict(vars(self.geometry))
        points, verdicts = ([dict(vars(one)) for one in many] for many in (self.keypoints, self.verdicts))
        return {**vars(self), "keypoints": points, "geometry": geometry, "verdicts": verdicts}

    @classmethod
    def from_json(cls, value: dict[str, Any]) -> Evidence:
        """The evidence of `to_json`; a garbled one raises KeyError, TypeError or ValueError."""
        geometry = value["geometry"]
        if geometry is not None:
            x, y, z = geometry["extents_m"]
            geometry = GeometryEvidence(**{**geometry, "extents_m": (x, y, z)})
        return cls(
            keypoints=tuple(KeypointEvidence(**point) for point in value["keypoints"]),
            geometry=geometry,
            is_fitted=bool(value["is_fitted"]),
            is_contradictory=bool(value["is_contradictory"]),
            tag_scale=value["tag_scale"],
            scan_tag_scale=value["scan_tag_scale"],
            verdicts=tuple(Verdict(**verdict) for verdict in value["verdicts"]),
        )


def measure(
    scan_from_sfm: Similarity,
    pairs: Correspondences,
    inlier: Bools,
    *,
    is_fitted: bool,
    is_contradictory: bool,
    tag_size_m: float | None,
    scan_tag_scale: float | None,
    model: SfmModel | None,
) -> Evidence:
    """The evidence on an alignment at K pairs, of which `inlier` (K,) agree, without verdicts yet.

    `scan_tag_scale` must come from elsewhere: tags on the scan are made squares of the known size.
    """
    distance = residuals(scan_from_sfm, pairs)
    pixels = np.full(len(pairs), np.nan) if model is None else reprojection_px(scan_from_sfm, pairs, model)
    left_out = leave_one_out(pairs, inlier).residuals() if is_fitted else np.full(len(pairs), np.nan)
    keypoints = tuple(
        KeypointEvidence(
            pairs.names[i],
            pairs.groups[i],
            float(distance[i]),
            _or_none(pixels[i]),
            _or_none(left_out[i]),
            bool(inlier[i]),
        )
        for i in range(len(pairs))
    )
    return Evidence(
        keypoints=keypoints,
        geometry=_geometry(scan_from_sfm, pairs.take(inlier), model) if inlier.sum() >= 3 else None,
        is_fitted=is_fitted,
        is_contradictory=is_contradictory,
        tag_scale=_tag_scale(pairs.sfm * scan_from_sfm.scale, pairs, tag_size_m),
        scan_tag_scale=scan_tag_scale,
    )


def reprojection_px(scan_from_sfm: Similarity, pairs: Correspondences, model: SfmModel, nearest: int = 10) -> Floats:
    """(K,) pixels between a pair's two sides, the mean over the `nearest` registered images that have both in view.

    NaN where no image has. Walls are not considered: an image may have the place in view and not see it.
    """
    sides = np.stack([pairs.sfm, scan_from_sfm.inverse().apply(pairs.scan)])
    centres = np.asarray(model.sfm_from_camera.translation)
    order = np.argsort(np.linalg.norm(pairs.sfm[:, None] - centres, axis=2), axis=1)
    seen, sums = np.zeros(len(pairs)), np.zeros(len(pairs))
    for first in range(0, len(model), 4 * nearest):
        rows = np.flatnonzero(seen < nearest)
        if len(rows) == 0:
            break
        apart = _apart_px(model, order[rows, first : first + 4 * nearest], sides[:, rows])
        sees = np.isfinite(apart)
        sees &= np.cumsum(sees, axis=1) + seen[rows, None] <= nearest
        sums[rows] += np.where(sees, apart, 0.0).sum(axis=1)
        seen[rows] += sees.sum(axis=1)
    return np.where(seen > 0, sums / np.maximum(seen, 1), np.nan)


def _apart_px(model: SfmModel, images: Ints, sides: Floats) -> Floats:
    """(K, C) pixels between two points each (2, K, 3) in the frame sfm, in `images` (K, C); NaN unless both are in."""
    rotations, centres = model.sfm_from_camera.rotation.as_matrix(), model.sfm_from_camera.translation
    in_camera = np.einsum("skci,kcij->skcj", sides[:, :, None] - centres[images], rotations[images])
    apart = np.full(images.shape, np.nan)
    cameras = model.image_camera_ids[images]
    for camera_id in np.unique(cameras):
        camera, here = model.cameras[int(camera_id)], cameras == camera_id
        first, second = (camera.project(side[here]) for side in in_camera)
        is_in = camera.contains(first) & camera.contains(second)
        apart[here] = np.where(is_in, np.linalg.norm(first - second, axis=1), np.nan)
    return apart


def fit_covariance(points_in_scan: Floats, pairs: Correspondences, centre: Floats) -> Floats:
    """(7, 7) covariance of the least-squares similarity (see `similarity_jacobian`) at the pairs' expected errors."""
    jacobian = similarity_jacobian(points_in_scan, centre)
    normal = np.einsum("k,kia,kib->ab", pairs.weights, jacobian, jacobian)
    return np.asarray(np.linalg.pinv(normal, hermitian=True), dtype=np.float64)


def _geometry(scan_from_sfm: Similarity, pairs: Correspondences, model: SfmModel | None) -> GeometryEvidence:
    mapped = scan_from_sfm.apply(pairs.sfm)
    centre = mapped.mean(axis=0)
    groups = len(pairs.group_names)
    # Errors larger than expected count, smaller ones do not: three points always fit well.
    excess = residuals(scan_from_sfm, pairs) ** 2 * pairs.weights
    freedom = max(3 * groups - 7, 1)
    covariance = fit_covariance(mapped, pairs, centre) * max(1.0, float(excess.sum()) / freedom)
    x, y, z = principal_extents(pairs.scan)
    baseline = float(np.linalg.norm(pairs.scan[:, None] - pairs.scan, axis=2).max())
    of_scene = camera_uncertainty = None
    if model is not None and len(model):
        cameras = scan_from_sfm.apply(model.sfm_from_camera.translation)
        spread = similarity_jacobian(cameras, centre)
        variance = np.einsum("nia,ab,nib->n", spread, covariance, spread)
        camera_uncertainty = float(np.sqrt(variance.mean()))
        scene = np.concatenate([cameras, scan_from_sfm.apply(model.points)])
        low, high = np.percentile(scene, [2, 98], axis=0)
        of_scene = baseline / max(float(np.linalg.norm(high - low)), 1e-9)
    return GeometryEvidence(
        (float(x), float(y), float(z)),
        baseline,
        of_scene,
        float(np.rad2deg(np.sqrt(np.trace(covariance[:3, :3])))),
        float(np.sqrt(covariance[6, 6])),
        camera_uncertainty,
    )


def _tag_scale(points: Floats, pairs: Correspondences, tag_size_m: float | None) -> float | None:
    """Median edge length of the groups of four (tags) in units of the known tag size."""
    if tag_size_m is None:
        return None
    edges: list[Floats] = []
    for group in range(len(pairs.group_names)):
        corners = points[pairs.of_group(group)]
        if len(corners) == 4:
            edges.append(np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1))
    return float(np.median(np.concatenate(edges))) / tag_size_m if edges else None


def _rms(values: list[float]) -> float | None:
    return float(np.sqrt(np.mean(np.square(values)))) if values else None


def _or_none(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
