"""The similarities that are fitted without one group of pairs, for every group, all in one go.

A fit without a group predicts where the group is (leave-one-out residual), and its difference to the fit with all is
what the group does. Fifty groups are fifty least-squares problems of 3x3: one batched decomposition instead of a loop.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gazeloc_core.alignment.correspondences import Correspondences
from gazeloc_core.alignment.similarity_fit import determines, solve_umeyama
from gazeloc_core.arrays import Bools, Floats

_NO_WEIGHT = 1e-300
"""Of pairs that are left out: nothing, but a sum of none of them can still be divided by."""


@dataclass(frozen=True, eq=False)
class LeftOut:
    """`scan_from_sfm` without each of G groups: `scale` (G,), `rotation` (G, 3, 3), `translation` (G, 3).

    `is_determined` (G,): whether the other groups determine one; the numbers of those that are not mean nothing.
    """

    pairs: Correspondences
    scale: Floats
    rotation: Floats
    translation: Floats
    is_determined: Bools

    def residuals(self) -> Floats:
        """(K,) metres between each pair's two sides under the fit without its group; NaN where there is none."""
        of = self.pairs.group_index
        turned = np.einsum("kij,kj->ki", self.rotation[of], self.pairs.sfm)
        mapped = self.scale[of, None] * turned + self.translation[of]
        apart = np.linalg.norm(mapped - self.pairs.scan, axis=1)
        return np.where(self.is_determined[of], apart, np.nan)

    def apply(self, group: int, points: Floats) -> Floats:
        """Points (N, 3) in the frame `sfm`, mapped by the fit without one group."""
        return np.asarray(self.scale[group] * points @ self.rotation[group].T + self.translation[group])


def leave_one_out(pairs: Correspondences, inlier: Bools) -> LeftOut:
    """The fits to the inliers (K,) of all groups but one, for each of the G groups."""
    kept = inlier & (np.arange(len(pairs.group_names))[:, None] != pairs.group_index)
    scale, rotation, translation = solve_umeyama(pairs.sfm, pairs.scan, np.where(kept, pairs.weights, _NO_WEIGHT))
    is_determined = determines(pairs.scan, kept) & determines(pairs.sfm, kept) & (scale > 0)
    return LeftOut(pairs, scale, rotation, translation, is_determined)
