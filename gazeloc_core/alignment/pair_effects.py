"""What each keypoint does to an alignment: the least-squares fit with it against the fit without it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gazeloc_core.alignment.correspondences import Correspondences
from gazeloc_core.alignment.left_out import leave_one_out
from gazeloc_core.arrays import Bools, Floats
from gazeloc_core.sfm_model import SfmModel
from gazeloc_core.transforms import Similarity


@dataclass(frozen=True, eq=False)
class PairEffects:
    """By group of pairs (G,), in the order of `Correspondences.group_names`; NaN where the others determine no fit.

    `left_out_m`: how far the group is from where the fit to all others puts it (root mean square over its points).
    `cameras_move_m`: how far the cameras move, on average, when the group is left out; 0 for one that does not count.
    """

    left_out_m: Floats
    cameras_move_m: Floats


def pair_effects(
    scan_from_sfm: Similarity, pairs: Correspondences, inlier: Bools, model: SfmModel | None
) -> PairEffects:
    """The effects under an alignment fitted to the inliers (K,) of the pairs; without a model no camera moves."""
    fits, count = leave_one_out(pairs, inlier), len(pairs.group_names)
    squares = np.bincount(pairs.group_index, weights=fits.residuals() ** 2, minlength=count)
    left_out = np.sqrt(squares / np.bincount(pairs.group_index, minlength=count))
    takes_part = np.bincount(pairs.group_index, weights=inlier, minlength=count) > 0
    moved = np.where(fits.is_determined & ~takes_part, 0.0, np.nan)
    centres = np.zeros((0, 3)) if model is None else np.asarray(model.sfm_from_camera.translation).reshape(-1, 3)
    here = scan_from_sfm.apply(centres)
    for group in np.flatnonzero(fits.is_determined & takes_part).tolist() if len(centres) else ():
        moved[group] = np.linalg.norm(fits.apply(group, centres) - here, axis=1).mean()
    return PairEffects(left_out, moved)
