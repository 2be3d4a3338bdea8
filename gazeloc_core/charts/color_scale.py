"""A colour scale for numbers: from dark blue over green to yellow, told apart by colour-blind eyes and in grey too."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gazeloc_core.arrays import Bytes

_STOPS = np.array(  # after viridis (van der Walt and Smith 2015), whose lightness rises evenly
    [(68, 1, 84), (65, 68, 135), (42, 120, 142), (34, 168, 132), (122, 209, 81), (253, 231, 37)], dtype=np.float64
)
NO_VALUE = (134, 142, 150)
"""Grey: nothing is known."""
_LEAST_SHARE = 0.95


@dataclass(frozen=True)
class ColorScale:
    """Values from `low` to `high` as colours; values beyond take the colour of the end."""

    low: float
    high: float

    @classmethod
    def of_errors(cls, values: ArrayLike) -> ColorScale | None:
        """From 0 to a round number above 95 % of the finite values, so that a few outliers hide nothing; None of none.

        Round numbers are 1, 2 and 5 times a power of ten.
        """
        finite = _finite(values)
        if len(finite) == 0:
            return None
        high = max(float(np.quantile(finite, _LEAST_SHARE)), 1e-9)
        power = 10.0 ** np.floor(np.log10(high))
        return cls(0.0, float(power * next(step for step in (1, 2, 5, 10) if step * power >= high * (1 - 1e-9))))

    @classmethod
    def of_range(cls, values: ArrayLike) -> ColorScale | None:
        """From the 2nd to the 98th percentile of the finite values; None of none."""
        finite = _finite(values)
        if len(finite) == 0:
            return None
        low, high = (float(value) for value in np.quantile(finite, [0.02, 0.98]))
        return cls(low, max(high, low + 1e-9))

    def colors(self, values: ArrayLike) -> Bytes:
        """sRGB colours (N, 3) of values (N,), grey where one is not finite."""
        v = np.asarray(values, dtype=np.float64)
        is_known = np.isfinite(v)
        place = np.clip((np.where(is_known, v, self.low) - self.low) / (self.high - self.low), 0, 1) * (len(_STOPS) - 1)
        channels = [np.interp(place, np.arange(len(_STOPS)), _STOPS[:, channel]) for channel in range(3)]
        return np.where(is_known[:, None], np.rint(np.stack(channels, axis=1)), NO_VALUE).astype(np.uint8)

    @staticmethod
    def css_gradient() -> str:
        """The scale from left to right, as CSS takes it."""
        stops = ",".join(f"rgb({r:.0f},{g:.0f},{b:.0f})" for r, g, b in _STOPS)
        return f"linear-gradient(90deg,{stops})"


def _finite(values: ArrayLike) -> NDArray[np.float64]:
    v = np.asarray(values, dtype=np.float64)
    return v[np.isfinite(v)]
