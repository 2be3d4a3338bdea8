"""A reconstruction bent to the tags on the scan, where tags that were left out prove that it is better so.

A reconstruction of a bare, hurried recording can hang together as by a hinge: each half is right, the angle between
them is not, and no similarity mends that. Tags on both sides of the hinge know better. Their corners join the bundle
adjustment as soft control points (anchored_bundle.py), which lie where the scan has them to about a centimetre.

Tags pull at the reconstruction with their own errors too, so this must prove itself: each tag is left out in turn, and
predicted by the others through the similarity alone, and through the bent reconstruction. On a made-up bare room
(hurried, five tags) it took the cameras from 4.2 cm and 1.35° to 2.5 cm and 0.59°.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from gazeloc_core.alignment.correspondences import Correspondences, gather
from gazeloc_core.alignment.proof import gains_of_groups, least_mean_gain, rms
from gazeloc_core.alignment.similarity_fit import fit_similarity, is_degenerate, robust_fit
from gazeloc_core.arrays import Bools, Floats
from gazeloc_core.bending.anchored_bundle import AnchorOptions, Anchors, anchor
from gazeloc_core.keypoints import KeypointSet
from gazeloc_core.progress import Report, part, silent
from gazeloc_core.sfm_model import SfmModel
from gazeloc_core.tag_types import TagCorners, TagSightings
from gazeloc_core.transforms import Similarity


@dataclass(frozen=True, kw_only=True)
class AnchoringOptions:
    """When a reconstruction is bent to the tags."""

    least_tags: int = 4
    """Tags on both sides that it takes: each is left out once, and three must remain."""
    most_images: int = 800
    """Larger reconstructions are left as they are: the adjustment solves for all cameras at once."""
    significance: float = 0.05
    """Probability at which a bend that gains nothing is accepted by chance."""
    bundle: AnchorOptions = field(default_factory=AnchorOptions)
    """How the adjustment weighs."""


@dataclass(frozen=True, eq=False)
class Anchoring:
    """The model, bent where `is_accepted`, else as it was; the sentence why; errors of tags left out, in metres."""

    model: SfmModel
    is_accepted: bool
    reason: str
    left_out_before_m: float | None = None
    left_out_after_m: float | None = None


def bend_to_tags(
    model: SfmModel,
    sightings: TagSightings,
    on_scan: TagCorners,
    in_sfm: TagCorners,
    options: AnchoringOptions | None = None,
    report: Report = silent,
) -> Anchoring:
    """The model bent to the tags that are `on_scan` and `in_sfm`, or left as it is; `sightings` in undistorted frames.

    Raises:
        Cancelled: when `report` raises it.
    """
    options = options or AnchoringOptions()
    pairs = gather(on_scan, in_sfm, KeypointSet())
    refusal = _refusal(model, pairs, options)
    if refusal:
        return Anchoring(model, False, f"Not bent to the tags: {refusal}.")
    fit = robust_fit(pairs)
    pairs = pairs.take(fit.inlier)
    if len(pairs.group_names) < options.least_tags:
        return Anchoring(model, False, f"Not bent to the tags: only {len(pairs.group_names)} of them agree.")
    anchors = _anchors(model, sightings, pairs, fit.scan_from_sfm)
    before, after = np.full(len(pairs), np.nan), np.full(len(pairs), np.nan)
    turns = len(pairs.group_names) + 1
    for turn, name in enumerate(pairs.group_names):
        held_out: Bools = pairs.of_group(turn)
        rest = pairs.take(~held_out)
        if is_degenerate(rest):
            continue
        share = part(report, turn / turns, (turn + 1) / turns)
        share(0, f"predicting {name} by the others")
        free = replace(anchors, sigma=np.where(held_out, np.inf, anchors.sigma))
        bent = anchor(model, free, options.bundle, share)
        before[held_out] = _errors(pairs, pairs.sfm, held_out)
        after[held_out] = _errors(pairs, bent.points, held_out)
    accepted, reason = _decide(pairs, before, after, options)
    if accepted:
        model = anchor(model, anchors, options.bundle, part(report, 1 - 1 / turns, 1)).model
    return Anchoring(model, accepted, reason, rms(before), rms(after))


def _refusal(model: SfmModel, pairs: Correspondences, options: AnchoringOptions) -> str:
    if len(pairs.group_names) < options.least_tags:
        return f"{len(pairs.group_names)} are on both sides, it takes {options.least_tags}"
    if len(model) > options.most_images:
        return f"it has {len(model)} images, more than {options.most_images}"
    if not all(camera.is_pinhole for camera in model.cameras.values()):
        return "its camera is not a pinhole one"
    if is_degenerate(pairs):
        return "they lie on one line"
    return ""


def _anchors(model: SfmModel, sightings: TagSightings, pairs: Correspondences, scan_from_sfm: Similarity) -> Anchors:
    """The corners of the pairs, in their order, where the scan has them.

    The adjustment takes its many observations for independent, which makes it stiffer than it should be; the corners of
    a tag are taken so too, for balance.
    """
    first = {int(group.removeprefix("tag ")): 4 * row for row, group in enumerate(pairs.group_names)}
    image_of = {int(frame): image for image, frame in enumerate(model.frame_indices) if frame >= 0}
    at = [(int(tag), int(frame)) for tag, frame in zip(sightings.tag_id, sightings.frame_index, strict=True)]
    seen = np.array([tag in first and frame in image_of for tag, frame in at], dtype=np.bool_)
    corners = [first[tag] for (tag, _), is_seen in zip(at, seen, strict=True) if is_seen]
    images = [image_of[frame] for (_, frame), is_seen in zip(at, seen, strict=True) if is_seen]
    return Anchors(
        points=scan_from_sfm.inverse().apply(pairs.scan),
        sigma=pairs.sigma_m / scan_from_sfm.scale,
        group=pairs.group_index,
        point=(np.array(corners)[:, None] + np.arange(4)).ravel(),
        image=np.repeat(images, 4),
        px=sightings.corners_px[seen].reshape(-1, 2),
    )


def _errors(pairs: Correspondences, points_in_sfm: Floats, held_out: Bools) -> Floats:
    """How far (H,) held-out pairs are off when the others, at `points_in_sfm` (K, 3), place the reconstruction."""
    fit = fit_similarity(points_in_sfm[~held_out], pairs.scan[~held_out], pairs.weights[~held_out])
    return np.asarray(np.linalg.norm(fit.apply(points_in_sfm[held_out]) - pairs.scan[held_out], axis=1))


def _decide(pairs: Correspondences, before_m: Floats, after_m: Floats, options: AnchoringOptions) -> tuple[bool, str]:
    gains, before, after = gains_of_groups(pairs, before_m, after_m), rms(before_m), rms(after_m)
    if len(gains) < 3 or before is None or after is None:
        return False, f"Not bent to the tags: only {len(gains)} of them could be left out in turn."
    numbers = f"tags left out in turn are off by {100 * after:.1f} cm, by {100 * before:.1f} cm as it was"
    if after < before and gains.mean() > least_mean_gain(gains, options.significance):
        return True, f"Bent to the tags: {numbers}."
    return False, f"Not bent to the tags, for that proves no better: {numbers}."
