"""Evidence on an alignment, put into words for people. Every verdict says what to do when it is not good."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from gazeloc_core.alignment.correspondences import Correspondences
from gazeloc_core.alignment.evidence import Evidence, GeometryEvidence, Level, Verdict
from gazeloc_core.alignment.similarity_fit import normalised_by_group, solve_umeyama
from gazeloc_core.arrays import Floats


@dataclass(frozen=True, kw_only=True)
class VerdictOptions:
    """Where good ends and bad begins."""

    good_residual_m: float = 0.02
    """Keypoint residuals (root mean square) up to this are good, in metres."""
    bad_residual_m: float = 0.06
    """Keypoint residuals above this are bad, in metres."""
    good_camera_m: float = 0.02
    """Expected error of the camera positions up to this is good, in metres."""
    bad_camera_m: float = 0.08
    """Expected error of the camera positions above this is bad, in metres."""
    good_rotation_deg: float = 0.5
    """Expected error of the rotation up to this is good, in degrees."""
    bad_rotation_deg: float = 2.0
    """Expected error of the rotation above this is bad, in degrees."""
    good_scale: float = 0.02
    """Tags whose size is off the known one by up to this share are good."""
    bad_scale: float = 0.06
    """Tags whose size is off the known one by more than this share are bad."""
    small_baseline: float = 0.25
    """Keypoints are too close together when they span less than this share of the scene."""


def verdicts_on(evidence: Evidence, pairs: Correspondences, options: VerdictOptions) -> tuple[Verdict, ...]:
    """What the evidence means, most important first."""
    found = [
        *_on_swaps(pairs, evidence),
        *_on_outliers(evidence),
        *_on_residuals(evidence, options),
        *_on_number(evidence),
    ]
    if evidence.geometry is not None:
        found += _on_geometry(evidence.geometry, options)
    found += _on_tag_size(evidence, options)
    return tuple(found)


def is_mirrored(pairs: Correspondences) -> bool:
    """Whether a mirror image fits the pairs far better than any turn does, beyond what errors explain."""
    proper, reflected = (float(_rms_error(pairs, pairs.scan, mirrored)) for mirrored in (False, True))
    return proper > 3.4 and reflected < 0.3 * proper


def best_swap(pairs: Correspondences) -> tuple[str, str] | None:
    """The two groups whose scan sides, exchanged, make a set that does not fit fit far better; None if there are none.

    Only groups of the same size can have been confused; more than 40 groups are not searched.
    """
    before = _rms_error(pairs, pairs.scan, mirrored=False)
    groups = [np.flatnonzero(pairs.of_group(g)) for g in range(len(pairs.group_names))]
    if before <= 3.4 or not 4 <= len(groups) <= 40:
        return None
    same_size = [(a, b) for a, b in combinations(range(len(groups)), 2) if len(groups[a]) == len(groups[b])]
    if not same_size:
        return None
    scans = np.repeat(pairs.scan[None], len(same_size), axis=0)
    for scan, (a, b) in zip(scans, same_size, strict=True):
        scan[groups[a]], scan[groups[b]] = pairs.scan[groups[b]], pairs.scan[groups[a]]
    errors = _rms_error(pairs, scans, mirrored=False)
    best = int(errors.argmin())
    if errors[best] >= 0.35 * before:
        return None
    first, second = same_size[best]
    return pairs.group_names[first], pairs.group_names[second]


def _rms_error(pairs: Correspondences, scan: Floats, mirrored: bool) -> Floats:
    """Root mean square over groups of the residual in expected errors, after the best fit to all pairs.

    `scan` is (..., K, 3), the answer (...).
    """
    scale, rotation, shift = solve_umeyama(pairs.sfm, scan, pairs.weights, mirrored=mirrored)
    mapped = scale[..., None, None] * (pairs.sfm @ np.swapaxes(rotation, -1, -2)) + shift[..., None, :]
    errors = normalised_by_group(np.linalg.norm(mapped - scan, axis=-1), pairs)
    return np.asarray(np.sqrt(np.mean(errors**2, axis=-1)))


def _on_swaps(pairs: Correspondences, evidence: Evidence) -> list[Verdict]:
    swapped = best_swap(pairs) if evidence.is_fitted else None
    if swapped is None:
        return []
    first, second = (_label(pairs, group) for group in swapped)
    text = (
        f"{first} and {second} look swapped: exchanged, all keypoints fit. Click one of them again on the right side."
    )
    return [Verdict("bad", text)]


def _on_outliers(evidence: Evidence) -> list[Verdict]:
    if evidence.is_contradictory:
        worst = max(evidence.keypoints, key=lambda point: point.residual_m)
        return [
            Verdict(
                "bad",
                f"The keypoints contradict each other (up to {_cm(worst.residual_m)} at {worst.name}) and are too few "
                "to say which one is wrong: check each of them, and add more.",
            )
        ]
    wrong: dict[str, float] = {}
    for point in evidence.keypoints:
        if not point.is_inlier:
            label = point.name if point.group in ("", point.name) or len(_members(evidence, point.group)) == 1 else ""
            wrong[label or point.group] = max(wrong.get(label or point.group, 0.0), point.residual_m)
    if not wrong:
        return []
    named = ", ".join(f"{name} (off by {_cm(metres)})" for name, metres in wrong.items())
    level: Level = "warning" if len(evidence.inliers) >= 0.6 * len(evidence.keypoints) else "bad"
    return [Verdict(level, f"Left out because they do not agree with the others: {named}. Click them again or delete.")]


def _on_residuals(evidence: Evidence, options: VerdictOptions) -> list[Verdict]:
    within, predicted = evidence.residual_rms_m, evidence.leave_one_out_rms_m
    if within is None:
        return [Verdict("warning", "No keypoints measure this alignment: click some pairs to see how good it is.")]
    decisive = within if predicted is None else predicted
    level = _level(decisive, options.good_residual_m, options.bad_residual_m)
    text = f"The keypoints fit to {_cm(within)}"
    text += f", and each is predicted by the others to {_cm(predicted)}." if predicted is not None else "."
    if level != "good":
        by_hand = any(len(_members(evidence, point.group)) == 1 for point in evidence.inliers)
        text += " Check the worst of them"
        text += ", and click in the middle of flat things, not on edges." if by_hand else ": was a tag moved, or bent?"
    return [Verdict(level, text)]


def _on_number(evidence: Evidence) -> list[Verdict]:
    groups = {point.group for point in evidence.inliers}
    if not evidence.is_fitted or len(groups) > 4:
        return []
    if len(groups) <= 3:
        text = f"Only {len(groups)} places hold this alignment: a wrong one could not be noticed. Add three or more."
    else:
        text = "Only 4 places hold this alignment: a wrong one could be noticed but not named. Add two or more."
    return [Verdict("warning", text)]


def _on_geometry(geometry: GeometryEvidence, options: VerdictOptions) -> list[Verdict]:
    found: list[Verdict] = []
    largest, middle, smallest = geometry.extents_m
    if geometry.baseline_of_scene is not None and geometry.baseline_of_scene < options.small_baseline:
        text = f"The keypoints span {geometry.baseline_m:.1f} m, {geometry.baseline_of_scene:.0%} of the scene."
        found.append(Verdict("warning", f"{text} Add some far from them, across the room."))
    if middle < 0.1 * largest:
        found.append(Verdict("warning", "The keypoints lie nearly on one line. Add one well away from it."))
    elif smallest < 0.03 * largest:
        text = "The keypoints lie nearly in one plane, so that a mirrored set would not be noticed."
        found.append(Verdict("warning", f"{text} Add one in front of it."))
    levels = [_level(geometry.rotation_uncertainty_deg, options.good_rotation_deg, options.bad_rotation_deg)]
    text = f"The keypoints' places determine the rotation to {geometry.rotation_uncertainty_deg:.2f}°"
    if geometry.camera_uncertainty_m is not None:
        levels.append(_level(geometry.camera_uncertainty_m, options.good_camera_m, options.bad_camera_m))
        text += f" and the camera positions to {_cm(geometry.camera_uncertainty_m)}"
    level: Level = "bad" if "bad" in levels else "warning" if "warning" in levels else "good"
    found.append(Verdict(level, text + ("." if level == "good" else ": add keypoints that lie farther apart.")))
    return found


def _on_tag_size(evidence: Evidence, options: VerdictOptions) -> list[Verdict]:
    ours, scan = evidence.tag_scale, evidence.scan_tag_scale
    if ours is None:
        return []
    off = max(abs(scale - 1) for scale in (ours, scan) if scale is not None)
    level = _level(off, options.good_scale, options.bad_scale)
    text = f"Tags come out at {ours:.1%} of the given size in the aligned reconstruction"
    text += "." if scan is None else f" and at {scan:.1%} on the scan."
    if level == "good":
        return [Verdict(level, text)]
    if scan is not None and abs(ours - scan) <= options.good_scale:
        size = "large" if ours > 1 else "small"
        return [
            Verdict(level, f"{text} Measure a tag: if its size was given right, the scan is too {size} by as much.")
        ]
    return [Verdict(level, f"{text} Check the tag size and the worst keypoints.")]


def _members(evidence: Evidence, group: str) -> list[str]:
    return [point.name for point in evidence.keypoints if point.group == group]


def _label(pairs: Correspondences, group: str) -> str:
    members = [name for name, of in zip(pairs.names, pairs.groups, strict=True) if of == group]
    return members[0] if len(members) == 1 else group


def _level(value: float, good: float, bad: float) -> Level:
    return "good" if value <= good else "warning" if value <= bad else "bad"


def _cm(metres: float) -> str:
    return f"{metres * 100:.1f} cm"
