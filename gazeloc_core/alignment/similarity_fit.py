"""The similarity between two sets of paired points: closed form, its uncertainty, and without the wrong pairs.

Closed form: S. Umeyama, "Least-squares estimation of transformation parameters between two point patterns", PAMI 13(4),
1991; equation numbers below are his, with weights added. Wrong pairs: every small set of groups (or many of them)
proposes a similarity, the one with the least truncated cost wins and is refitted to the groups that agree (LO-RANSAC;
for few points an exhaustive search, so that the answer is always the same).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from math import comb

import numpy as np
from scipy.spatial.transform import Rotation

from gazeloc_core.alignment.correspondences import Correspondences
from gazeloc_core.arrays import Bools, Floats, Ints
from gazeloc_core.errors import GeometryError
from gazeloc_core.transforms import Similarity

COLLINEAR_RATIO = 0.02
"""Second to first singular value of centred points below which they count as lying on one line."""


@dataclass(frozen=True, kw_only=True)
class RobustOptions:
    """How wrong pairs are told from right ones."""

    inlier_sigmas: float = 3.4
    """A group is wrong when its residual exceeds this many times the expected error (3.4: 1 % of right ones do)."""
    max_inflation: float = 3.0
    """How many times larger than expected the error of the right pairs may turn out to be."""
    max_subsets: int = 1500
    """Sets of groups that are tried; all of them when there are no more than this."""
    seed: int = 0
    """Chooses the sets that are tried when there are too many."""


@dataclass(frozen=True, eq=False)
class RobustFit:
    """The similarity fitted to the pairs that agree, `inlier` (K,).

    `is_contradictory`: the pairs do not agree, and are too few to say which of them is wrong; then all were used.
    """

    scan_from_sfm: Similarity
    inlier: Bools
    is_contradictory: bool


def solve_umeyama(
    sfm: Floats, scan: Floats, weights: Floats, *, mirrored: bool = False
) -> tuple[Floats, Floats, Floats]:
    """Scale (...), rotation (..., 3, 3) and translation (..., 3) that map `sfm` (..., K, 3) best to `scan`.

    Weights are (..., K); leading axes are broadcast. With `mirrored` the best *reflection* is returned in place of the
    rotation.
    """
    w = weights / weights.sum(axis=-1, keepdims=True)
    mean_sfm = np.einsum("...k,...ki->...i", w, sfm)  # (34)
    mean_scan = np.einsum("...k,...ki->...i", w, scan)  # (35)
    from_mean_sfm, from_mean_scan = sfm - mean_sfm[..., None, :], scan - mean_scan[..., None, :]
    variance_sfm = np.einsum("...k,...ki->...", w, from_mean_sfm**2)  # (36)
    covariance = np.einsum("...k,...ki,...kj->...ij", w, from_mean_scan, from_mean_sfm)  # (38)
    u, d, vt = np.linalg.svd(covariance)
    sign = np.sign(np.linalg.det(u) * np.linalg.det(vt))  # (43), which covers (39) and flat sets
    s = np.ones_like(d)
    s[..., 2] = -sign if mirrored else sign
    rotation = u * s[..., None, :] @ vt  # (40)
    scale = (d * s).sum(axis=-1) / np.maximum(variance_sfm, 1e-300)  # (42)
    translation = mean_scan - scale[..., None] * np.einsum("...ij,...j->...i", rotation, mean_sfm)  # (41)
    return scale, rotation, translation


def fit_similarity(sfm: Floats, scan: Floats, weights: Floats | None = None) -> Similarity:
    """The least-squares `scan_from_sfm` of paired points (K, 3); see `check_geometry` for what K pairs must be.

    Raises:
        GeometryError: if the scale is not positive, as for points that coincide.
    """
    w = np.ones(len(sfm)) if weights is None else weights
    scale, rotation, translation = solve_umeyama(sfm, scan, w)
    return Similarity(float(scale), Rotation.from_matrix(rotation), translation)


def principal_extents(points: Floats) -> Floats:
    """Standard deviations (3,) of points (K, 3) along their principal axes, largest first, in the points' unit."""
    values = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return np.asarray(np.pad(values, (0, 3 - len(values))) / np.sqrt(len(points)), dtype=np.float64)


def check_geometry(pairs: Correspondences) -> None:
    """Refuse pairs that no similarity can be found from.

    Raises:
        GeometryError: for fewer than three pairs, fewer than three different places, or places on one line.
    """
    if len(pairs) < 3:
        raise GeometryError(
            f"There are {len(pairs)} keypoint pairs, an alignment needs at least three that lie apart; "
            "click more pairs, or record and scan more tags."
        )
    for points, side in ((pairs.scan, "scan"), (pairs.sfm, "reconstruction")):
        if determines(points, np.ones(len(points), dtype=np.bool_)):
            continue
        extents = principal_extents(points)
        resolution = max(float(extents[0]), 1e-12 * float(np.abs(points).max(initial=1.0))) * 1e-4
        different = len(np.unique(np.round((points - points.mean(axis=0)) / resolution), axis=0))
        if different < 3:
            raise GeometryError(
                f"The {len(points)} keypoints ({_list(pairs.names)}) are at {different} different places of the "
                f"{side}, an alignment needs at least three; click them at different places."
            )
        raise GeometryError(
            f"The {len(points)} keypoints ({_list(pairs.names)}) lie on one line of the {side}, around which the "
            "room could turn freely; add one well away from that line."
        )


def determines(points: Floats, kept: Bools) -> Bools:
    """(...) whether the `kept` (..., K) of points (K, 3) lie at three places at least, and not on one line."""
    count = kept.sum(axis=-1)
    if points.shape[0] < 3:
        return np.zeros(count.shape, dtype=np.bool_)
    mean = kept @ points / np.maximum(count, 1)[..., None]
    values = np.linalg.svd((points - mean[..., None, :]) * kept[..., None], compute_uv=False)
    nothing = 1e-12 * float(np.abs(points).max(initial=1.0)) * np.sqrt(np.maximum(count, 1))
    is_spread = (values[..., 0] > nothing) & (values[..., 1] >= COLLINEAR_RATIO * values[..., 0])
    return np.asarray((count >= 3) & is_spread)


def is_degenerate(pairs: Correspondences) -> bool:
    """Whether `check_geometry` refuses the pairs."""
    everything = np.ones(len(pairs), dtype=np.bool_)
    return not all(bool(determines(side, everything)) for side in (pairs.scan, pairs.sfm))


def similarity_jacobian(points_in_scan: Floats, centre: Floats) -> Floats:
    """(K, 3, 7) how mapped points move with a turn (rad) about `centre`, a shift (m) and a relative change of scale."""
    q = points_in_scan - centre
    jacobian = np.zeros((len(q), 3, 7))
    jacobian[:, 0, 1], jacobian[:, 0, 2] = q[:, 2], -q[:, 1]
    jacobian[:, 1, 0], jacobian[:, 1, 2] = -q[:, 2], q[:, 0]
    jacobian[:, 2, 0], jacobian[:, 2, 1] = q[:, 1], -q[:, 0]
    jacobian[:, :, 3:6] = np.eye(3)
    jacobian[:, :, 6] = q
    return jacobian


def residuals(scan_from_sfm: Similarity, pairs: Correspondences) -> Floats:
    """(K,) distances in metres between the scan points and the mapped sfm points."""
    return np.asarray(np.linalg.norm(scan_from_sfm.apply(pairs.sfm) - pairs.scan, axis=1), dtype=np.float64)


def normalised_by_group(distances: Floats, pairs: Correspondences) -> Floats:
    """(..., G) root mean square of `distances` (..., K) over each group, in units of the expected error."""
    size = np.bincount(pairs.group_index)
    member = np.arange(len(size)) == pairs.group_index[:, None]
    return np.asarray(np.sqrt((distances / pairs.sigma_m) ** 2 @ (member / size)), dtype=np.float64)


def robust_fit(pairs: Correspondences, options: RobustOptions | None = None) -> RobustFit:
    """The similarity that most groups of pairs agree on, fitted to those.

    With three groups nothing can be found wrong; with four clicked points a contradiction can be noticed, but not who
    is to blame (any three of them fit nearly perfectly), so at least four groups must agree before any is dropped.

    Raises:
        GeometryError: see `check_geometry`.
    """
    options = options or RobustOptions()
    check_geometry(pairs)
    everything = np.ones(len(pairs), dtype=np.bool_)
    all_fitted = fit_similarity(pairs.sfm, pairs.scan, pairs.weights)
    errors = normalised_by_group(residuals(all_fitted, pairs), pairs)
    if (errors <= options.inlier_sigmas).all():
        return RobustFit(all_fitted, everything, is_contradictory=False)
    proposals = _best_proposals(pairs, options) if len(errors) > 3 else []
    agreements = [found for proposal in proposals if (found := _agreeing(proposal, pairs, options)) is not None]
    if agreements:
        inlier, _ = min(agreements, key=lambda agreement: agreement[1])
        kept = pairs.take(inlier)
        return RobustFit(fit_similarity(kept.sfm, kept.scan, kept.weights), inlier, is_contradictory=False)
    return RobustFit(all_fitted, everything, is_contradictory=True)


def _best_proposals(pairs: Correspondences, options: RobustOptions, count: int = 10) -> list[Floats]:
    """Normalised group errors (G,) under the best of the similarities that small sets of groups propose."""
    subsets = _subsets(len(pairs.group_names), options)
    is_chosen = np.zeros((len(subsets), len(pairs.group_names)), dtype=np.bool_)
    np.put_along_axis(is_chosen, subsets, True, axis=1)
    weights = np.where(is_chosen[:, pairs.group_index], pairs.weights, 0.0)
    scale, rotation, shift = solve_umeyama(pairs.sfm, pairs.scan, weights)
    mapped = scale[:, None, None] * (pairs.sfm @ np.swapaxes(rotation, 1, 2)) + shift[:, None]
    errors = normalised_by_group(np.linalg.norm(mapped - pairs.scan, axis=2), pairs)
    errors = np.where(np.isfinite(errors), errors, np.inf)  # three groups at one place propose nothing
    limit = options.inlier_sigmas * options.max_inflation
    best = np.argsort((np.minimum(errors, limit) ** 2).sum(axis=1), kind="stable")[:count]
    return list(errors[best])


def _cost(errors: Floats, limit: float) -> float:
    return float((np.minimum(errors, limit) ** 2).sum())


def _subsets(count: int, options: RobustOptions) -> Ints:
    """(S, 3) sets of groups."""
    if comb(count, 3) <= options.max_subsets:
        return np.array(list(combinations(range(count), 3)), dtype=np.int64)
    rng = np.random.default_rng(options.seed)
    return np.argpartition(rng.random((options.max_subsets, count)), 3, axis=1)[:, :3].astype(np.int64)


def _agreeing(errors: Floats, pairs: Correspondences, options: RobustOptions) -> tuple[Bools, float] | None:
    """Inlier mask (K,) after refitting until it is stable, and its cost; None where fewer than four groups agree.

    A similarity through three groups errs more elsewhere than a fit to all: the first refits are generous.
    """
    inlier = np.zeros(len(pairs), dtype=np.bool_)
    agreeing = np.zeros(len(errors), dtype=np.bool_)
    for iteration in range(20):
        least = max(1.0, options.max_inflation - 0.5 * iteration)
        inflation = float(np.clip(_spread(errors, agreeing), least, options.max_inflation))
        agreeing = errors <= options.inlier_sigmas * inflation
        before, inlier = inlier, agreeing[pairs.group_index]
        kept = pairs.take(inlier)
        if agreeing.sum() < 4 or is_degenerate(kept):
            return None
        if least == 1.0 and (inlier == before).all():
            break
        fit = fit_similarity(kept.sfm, kept.scan, kept.weights)
        errors = normalised_by_group(residuals(fit, pairs), pairs)
    return inlier, _cost(errors, options.inlier_sigmas)


def _spread(errors: Floats, fitted: Bools) -> float:
    """How many times larger than expected the errors of the better half are, 1.54 being a normal vector's median.

    The groups that were fitted (with 7 of their 3 coordinates each used up) show less than their true errors.
    """
    freedom = 3 * int(fitted.sum())
    shrunk = float(np.sqrt(freedom / (freedom - 7))) if freedom > 7 else 1.0
    return float(np.median(errors)) / 1.54 * shrunk


def _list(names: tuple[str, ...]) -> str:
    shown = ", ".join(names[:4])
    return shown if len(names) <= 4 else f"{shown} and {len(names) - 4} more"
