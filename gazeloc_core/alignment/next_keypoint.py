"""Where the next keypoint helps most: what one more pair at a place does to the uncertainty of the alignment.

First-order propagation as in evidence.py. The pairs so far determine the seven numbers of the similarity (a turn, a
shift, a change of scale, about the pairs' middle) with the information matrix N, the sum of J' J / sigma^2. A pair at
a candidate place adds its own J' J / sigma^2, wherever it will be clicked exactly; the inverse of the sum says how well
the cameras would then be known. Before three pairs determine anything, a weak prior (a room is upright to a radian or
so, and somewhere) stands in, so that the first places are spread out already.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from gazeloc_core.alignment.correspondences import Correspondences
from gazeloc_core.alignment.similarity_fit import residuals, similarity_jacobian
from gazeloc_core.arrays import Floats
from gazeloc_core.transforms import Similarity

Kind = Literal["rotation", "position", "scale"]


@dataclass(frozen=True, kw_only=True)
class SuggestionOptions:
    """What is aimed at, and what a click is expected to be off by."""

    click_sigma_m: float = 0.02
    """Expected error of the next pair per axis, both sides together, in metres."""
    position_goal_m: float = 0.01
    """Cameras known to this, in metres, ..."""
    rotation_goal_deg: float = 0.2
    """... and the rotation known to this, in degrees, weigh the same."""
    prior_rotation_deg: float = 60.0
    """What is known of the rotation before any pair, as a standard deviation in degrees."""
    prior_position_m: float = 5.0
    """The same of the position, in metres."""
    prior_scale: float = 1.0
    """The same of the scale, as a share."""


@dataclass(frozen=True)
class Weakness:
    """The motion of the reconstruction that the pairs determine worst: what it mostly is, how far it moves cameras.

    `axis` (3,) is a unit vector in the frame `scan`: of a rotation its axis, of a position the direction.
    """

    kind: Kind
    axis: tuple[float, float, float]
    cameras_m: float
    """By how much it moves the cameras (root mean square), as a standard deviation in metres."""


@dataclass(frozen=True)
class Suggestion:
    """A candidate by its row, and what a pair there is expected to do: standard deviations before and after it."""

    candidate: int
    cameras_before_m: float
    cameras_after_m: float
    rotation_before_deg: float
    rotation_after_deg: float
    weakness: Weakness
    weakness_left: float
    """How much of the weakest motion's uncertainty is left after it, as a share."""


def suggest(
    scan_from_sfm: Similarity,
    pairs: Correspondences,
    candidates_in_scan: Floats,
    camera_centers_in_scan: Floats,
    options: SuggestionOptions | None = None,
) -> Suggestion | None:
    """The best of the candidates (C, 3) for the next pair, None without candidates or cameras (N, 3).

    `pairs` are those that count so far, none or more, under `scan_from_sfm`, a guess before there are three.
    """
    options = options or SuggestionOptions()
    if len(candidates_in_scan) == 0 or len(camera_centers_in_scan) == 0:
        return None
    # About the pairs' middle a turn that they leave open is a turn and nothing else, so it can be named.
    middle_of = scan_from_sfm.apply(pairs.sfm) if len(pairs) else camera_centers_in_scan
    centre = middle_of.mean(axis=0)
    information, inflation = _information(scan_from_sfm, pairs, centre, options)
    of_cameras = similarity_jacobian(camera_centers_in_scan, centre)
    spread = np.einsum("nia,nib->ab", of_cameras, of_cameras) / len(of_cameras)
    of_candidates = similarity_jacobian(candidates_in_scan, centre) / options.click_sigma_m
    gained = np.einsum("cia,cib->cab", of_candidates, of_candidates)
    after = np.asarray(np.linalg.inv(information + gained), dtype=np.float64)
    cameras, rotation = np.einsum("cab,ab->c", after, spread), np.trace(after[:, :3, :3], axis1=1, axis2=2)
    goal = cameras / options.position_goal_m**2 + rotation / np.deg2rad(options.rotation_goal_deg) ** 2
    best = int(goal.argmin())
    before = np.asarray(np.linalg.inv(information), dtype=np.float64)
    motion = _weakest(before, spread)
    left = float(np.sqrt(_share(after[best], before, motion, spread)))
    return Suggestion(
        candidate=best,
        cameras_before_m=inflation * float(np.sqrt(np.einsum("ab,ab->", before, spread))),
        cameras_after_m=inflation * float(np.sqrt(cameras[best])),
        rotation_before_deg=inflation * float(np.rad2deg(np.sqrt(np.trace(before[:3, :3])))),
        rotation_after_deg=inflation * float(np.rad2deg(np.sqrt(rotation[best]))),
        weakness=_named(inflation * motion, spread),
        weakness_left=left,
    )


def _information(
    scan_from_sfm: Similarity, pairs: Correspondences, centre: Floats, options: SuggestionOptions
) -> tuple[Floats, float]:
    """(7, 7) what is known so far, and how many times larger than expected the pairs' errors turned out (1 or more)."""
    rotation = np.full(3, np.deg2rad(options.prior_rotation_deg))
    prior = np.concatenate([rotation, np.full(3, options.prior_position_m), [options.prior_scale]])
    known = np.diag(prior**-2.0)
    if len(pairs) == 0:
        return known, 1.0
    jacobian = similarity_jacobian(scan_from_sfm.apply(pairs.sfm), centre)
    known = known + np.einsum("k,kia,kib->ab", pairs.weights, jacobian, jacobian)
    freedom = 3 * len(pairs.group_names) - 7
    if freedom <= 0:
        return known, 1.0
    excess = float((residuals(scan_from_sfm, pairs) ** 2 * pairs.weights).sum()) / freedom
    return known, float(np.sqrt(max(1.0, excess)))


def _weakest(covariance: Floats, spread: Floats) -> Floats:
    """(7,) the motion, one standard deviation of it, that moves the cameras most."""
    values, vectors = np.linalg.eigh(covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    _, directions = np.linalg.eigh(root.T @ spread @ root)
    return np.asarray(root @ directions[:, -1])


def _share(after: Floats, before: Floats, motion: Floats, spread: Floats) -> float:
    """How much of the variance along a motion is left: what of it the cameras show is measured in both."""
    seen = spread @ motion
    return float(seen @ after @ seen) / max(float(seen @ before @ seen), 1e-300)


def _named(motion: Floats, spread: Floats) -> Weakness:
    parts: dict[Kind, slice] = {"rotation": slice(0, 3), "position": slice(3, 6), "scale": slice(6, 7)}
    moved = {kind: float(motion[part] @ spread[part, part] @ motion[part]) for kind, part in parts.items()}
    kind = max(parts, key=lambda kind: moved[kind])
    direction = motion[parts[kind]] if kind != "scale" else np.array([0.0, 0.0, 0.0])
    x, y, z = (direction / max(float(np.linalg.norm(direction)), 1e-12)).tolist()
    return Weakness(kind, (x, y, z), float(np.sqrt(max(float(motion @ spread @ motion), 0.0))))
