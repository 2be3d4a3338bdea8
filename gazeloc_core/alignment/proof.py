"""Whether keypoints that a refinement did not use prove that it made an alignment better: errors before and after."""

from __future__ import annotations

import numpy as np
from scipy.special import stdtrit  # not scipy.stats, which takes a second to import

from gazeloc_core.alignment.correspondences import Correspondences
from gazeloc_core.arrays import Floats


def gains_of_groups(pairs: Correspondences, before_m: Floats, after_m: Floats) -> Floats:
    """(G,) logarithm of how many times smaller each comparable group's error became; errors (K,), NaN for none.

    The expected error of a keypoint is added to both sides, so that luck below it does not count.
    """
    gains = []
    for group in range(len(pairs.group_names)):
        members = pairs.of_group(group) & np.isfinite(before_m) & np.isfinite(after_m)
        if members.any():
            floor = np.mean(pairs.sigma_m[members] ** 2)
            before, after = (np.mean(errors[members] ** 2) + floor for errors in (before_m, after_m))
            gains.append(0.5 * np.log(before / after))
    return np.array(gains)


def least_mean_gain(gains: Floats, significance: float) -> float:
    """The mean of gains (G,) that chance exceeds with probability `significance`, by Student's t-test."""
    spread = max(float(gains.std(ddof=1)), 1e-9) / np.sqrt(len(gains))
    return float(stdtrit(len(gains) - 1, 1 - significance) * spread)


def rms(errors: Floats) -> float | None:
    """The root mean square of the errors that are known; None where none is."""
    known = errors[np.isfinite(errors)]
    return float(np.sqrt(np.mean(known**2))) if len(known) else None
