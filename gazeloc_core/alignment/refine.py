"""Refinement of an alignment by ICP, and the decision whether it may replace its start.

ICP is judged at keypoints, which it does not use, and by pictures where a caller can compare them; never by its own
overlap or residual. The comparison must be fair to both sides:

- A start that was *not* fitted to the keypoints: its residuals against ICP's, at the same keypoints.
- A start that *was* fitted to them has residuals that flatter it, and ICP inherits some of that (all of it, if it does
  not move). So the keypoints are left out in turns: each fold is predicted once by the alignment fitted to the others,
  and once by ICP started from that alignment. An ICP that does nothing ties; one that finds the true place wins.
  Leaving out punishes the start: in use it is fitted to all keypoints. For least squares with leverage H (the fold's
  block of the hat matrix) the expected squared error of a new keypoint is E (I + H) under the full fit, E (I - H)^-1
  under the fit without the fold; the start's squared errors are scaled by the ratio of the traces.

Each group of keypoints then says how many times smaller its error became (a logarithm, with the expected error of a
keypoint added to both sides so that luck below it does not count). ICP is accepted when the mean over groups is above
zero by a one-sided t-test at 5 %, and the root mean square error is smaller too. Where the keypoints decide neither for
nor against it, pictures may. A few keypoints that an alignment was fitted to seldom prove that ICP is better: it must
then be shown to a person.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from gazeloc_core.alignment.alignment import Alignment, AlignmentMethod, AlignOptions, consensus, judge
from gazeloc_core.alignment.correspondences import Correspondences
from gazeloc_core.alignment.icp import IcpOptions, Overlap, Target, choose_points, overlap, run_icp
from gazeloc_core.alignment.proof import gains_of_groups, least_mean_gain, rms
from gazeloc_core.alignment.similarity_fit import fit_similarity, is_degenerate, residuals, similarity_jacobian
from gazeloc_core.arrays import Bools, Floats
from gazeloc_core.progress import Report, part, silent
from gazeloc_core.sfm_model import SfmModel
from gazeloc_core.surfaces.raycast import Raycaster
from gazeloc_core.transforms import Similarity

Agreement = Callable[[Similarity], float]
"""How well pictures agree under a `scan_from_sfm`, larger is better; for example renders against frames."""

VARIANTS = (AlignmentMethod.ICP_POINT_TO_POINT, AlignmentMethod.ICP_POINT_TO_PLANE)


@dataclass(frozen=True, kw_only=True)
class RefineOptions:
    """How an alignment is refined by ICP, and what it takes to accept the result."""

    icp: IcpOptions = field(default_factory=IcpOptions)
    """Which points take part, and how near to the mesh they must be."""
    reach: float = 4.0
    """Points take part up to this many times the distance that the start's keypoints are off by."""
    folds: int = 5
    """In how many turns keypoints are left out to compare fairly with a start that was fitted to them."""
    significance: float = 0.05
    """Probability at which an ICP that gains nothing is accepted by chance."""
    min_agreement_gain: float = 0.005
    """By how much the pictures' agreement must change to count."""
    align: AlignOptions = field(default_factory=AlignOptions)
    """How alignments are judged."""


@dataclass(frozen=True)
class Candidate:
    """What one variant of ICP made of the start.

    `keypoints_before_m` and `keypoints_after_m`: root mean square errors at keypoints, compared fairly (None where that
    is not possible). `agreement_*` of pictures, None without. `overlap_*` is ICP's own view.
    """

    alignment: Alignment
    accepted: bool
    reason: str
    keypoints_before_m: float | None
    keypoints_after_m: float | None
    agreement_before: float | None
    agreement_after: float | None
    overlap_before: Overlap
    overlap_after: Overlap

    def to_json(self) -> dict[str, Any]:
        """A JSON object for reports; the alignment by its key."""
        value = {name: getattr(self, name) for name in self.__dataclass_fields__ if name != "alignment"}
        value["overlap_before"], value["overlap_after"] = asdict(self.overlap_before), asdict(self.overlap_after)
        return {"alignment": self.alignment.key, "method": self.alignment.method.value, **value}


@dataclass(frozen=True)
class Refinement:
    """Both variants, and the one that the evidence prefers: `best`. It is put in force only if it is `accepted`."""

    start: Alignment
    candidates: tuple[Candidate, ...]
    best: Candidate

    @property
    def accepted(self) -> bool:
        """Whether the best variant is better than the start, on evidence that ICP did not optimise."""
        return self.best.accepted

    @property
    def reason(self) -> str:
        """Why it was accepted or refused, a sentence."""
        return self.best.reason

    @property
    def chosen(self) -> Alignment:
        """The alignment to use: the best variant if it was accepted, else the start."""
        return self.best.alignment if self.accepted else self.start

    def to_json(self) -> dict[str, Any]:
        """A JSON object for reports; alignments by their keys."""
        return {
            "start": self.start.key,
            "chosen": self.chosen.key,
            "accepted": self.accepted,
            "reason": self.reason,
            "candidates": [candidate.to_json() for candidate in self.candidates],
        }


@dataclass(frozen=True, eq=False)
class _Fold:
    """Keypoints `held_out` (K,) of the comparison, what they are compared under, and the start's correction."""

    held_out: Bools
    start: Similarity
    correction: float


def refine(
    start: Alignment,
    model: SfmModel,
    raycaster: Raycaster,
    pairs: Correspondences,
    options: RefineOptions | None = None,
    report: Report = silent,
    *,
    agreement: Agreement | None = None,
) -> Refinement:
    """Both variants of ICP from `start`, judged at the keypoint `pairs` (maybe none) and by `agreement`.

    Raises:
        GeometryError: if too few points of the reconstruction lie near the scan.
        Cancelled: if `report` does.
    """
    options = options or RefineOptions()
    target, icp = Target(raycaster), replace(options.icp, schedule_m=_schedule(start, options))
    points = choose_points(model, start.scan_from_sfm, target, icp)
    kept = pairs.take(consensus(pairs, options.align.robust))
    folds = _folds(kept, start, options.folds)
    agreement_before = None if agreement is None else agreement(start.scan_from_sfm)
    candidates = []
    for position, method in enumerate(VARIANTS):
        progress = part(report, position / len(VARIANTS), (position + 1) / len(VARIANTS))
        share = 1 / (1 + len(folds))
        found = run_icp(start.scan_from_sfm, points, target, method, icp, part(progress, 0, share))
        before, after = np.full(len(kept), np.nan), np.full(len(kept), np.nan)
        for turn, fold in enumerate(folds, start=1):
            held_out = kept.take(fold.held_out)
            result = found
            if start.evidence.is_fitted:
                turn_report = part(progress, turn * share, (turn + 1) * share)
                result = run_icp(fold.start, points, target, method, icp, turn_report)
            before[fold.held_out] = residuals(fold.start, held_out) * np.sqrt(fold.correction)
            after[fold.held_out] = residuals(result, held_out)
        refined = judge(found, pairs, options.align, method=method, parent=start.key, model=model)
        accepted, reason = decide(
            kept,
            before,
            after,
            agreement_before,
            agreement_after := None if agreement is None else agreement(found),
            options,
        )
        within = icp.schedule_m[-1]
        candidates.append(
            Candidate(
                refined,
                accepted,
                reason,
                rms(before),
                rms(after),
                agreement_before,
                agreement_after,
                overlap(start.scan_from_sfm.apply(points), target, within),
                overlap(found.apply(points), target, within),
            )
        )
    return Refinement(start, tuple(candidates), min(candidates, key=_preference))


def decide(
    pairs: Correspondences,
    before_m: Floats,
    after_m: Floats,
    agreement_before: float | None,
    agreement_after: float | None,
    options: RefineOptions,
) -> tuple[bool, str]:
    """Whether ICP's result is accepted, and the sentence why, from fair errors (K,) at keypoints (NaN: none)."""
    pictures, compared = 0.0, ""
    if agreement_before is not None and agreement_after is not None:
        pictures = agreement_after - agreement_before
        compared = f"({agreement_before:.3f} before, {agreement_after:.3f} after)"
        if pictures < -options.min_agreement_gain:
            return False, f"Refused: the pictures agree less {compared}."
    gains = gains_of_groups(pairs, before_m, after_m)
    before, after = rms(before_m), rms(after_m)
    if len(gains) >= 3 and before is not None and after is not None:
        needed = least_mean_gain(gains, options.significance)
        numbers = f"keypoints that ICP did not use are off by {after * 100:.1f} cm, by {before * 100:.1f} cm before"
        if after < before and gains.mean() > needed:
            return True, f"Accepted: {numbers}."
        if gains.mean() < -needed:
            return False, f"Refused: {numbers}."
    else:
        numbers = f"only {len(gains)} places measure the result independently, three are needed"
    if pictures > options.min_agreement_gain:
        return True, f"Accepted: the pictures agree better {compared}; {numbers}."
    return False, f"Refused: {numbers}. That is no proof: compare by eye and choose it yourself, or add keypoints."


def _schedule(start: Alignment, options: RefineOptions) -> tuple[float, ...]:
    """The distances of ICP, without those far beyond what the start's keypoints say it is off by.

    A start that is right to a centimetre must not be drawn to surfaces 30 cm away.
    """
    off_by = start.evidence.leave_one_out_rms_m or start.evidence.residual_rms_m
    widest = options.icp.schedule_m[0] if off_by is None else options.reach * off_by
    return tuple(within for within in options.icp.schedule_m if within <= widest) or options.icp.schedule_m[-1:]


def _folds(pairs: Correspondences, start: Alignment, count: int) -> list[_Fold]:
    """The turns in which keypoints are compared; none where they cannot be compared fairly."""
    groups = len(pairs.group_names)
    if groups == 0:
        return []
    if not start.evidence.is_fitted:
        return [_Fold(np.ones(len(pairs), dtype=np.bool_), start.scan_from_sfm, 1.0)]
    folds = []
    for turn in range(min(count, groups)):
        held_out = np.asarray(pairs.group_index % count == turn)
        rest = pairs.take(~held_out)
        if is_degenerate(rest):
            continue
        fit = fit_similarity(rest.sfm, rest.scan, rest.weights)
        correction = _correction(pairs, held_out, start.scan_from_sfm)
        if correction is not None:
            folds.append(_Fold(held_out, fit, correction))
    return folds


def _correction(pairs: Correspondences, held_out: Bools, scan_from_sfm: Similarity) -> float | None:
    """trace(I + H) / trace((I - H)^-1) for the held-out block H of the hat matrix, None where it is singular."""
    mapped = scan_from_sfm.apply(pairs.sfm)
    jacobian = similarity_jacobian(mapped, mapped.mean(axis=0)) * np.sqrt(pairs.weights)[:, None, None]
    rows = jacobian[held_out].reshape(-1, 7)
    flat = jacobian.reshape(-1, 7)
    hat = rows @ np.linalg.pinv(flat.T @ flat, hermitian=True) @ rows.T
    eigenvalues = np.linalg.eigvalsh(hat)
    if eigenvalues.max() > 1 - 1e-6:
        return None
    return float((1 + eigenvalues).sum() / (1 / (1 - eigenvalues)).sum())


def _preference(candidate: Candidate) -> tuple[bool, float, float]:
    """Sorts the accepted first, then by error at keypoints, then by agreement of pictures."""
    error = candidate.keypoints_after_m
    agreement = candidate.agreement_after
    return (
        not candidate.accepted,
        float("inf") if error is None else error,
        0.0 if agreement is None else -agreement,
    )
