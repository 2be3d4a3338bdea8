"""How much longer a job takes, as far as its progress tells: a range where it is uneven, nothing where it is too early.

Two estimates, from the pace since the start and from that of the last half minute. Stages differ, so the two rarely
agree, and the truth lies around them: both are said.
"""

from __future__ import annotations

from collections import deque

MIN_FRACTION = 0.08
MIN_SECONDS = 5.0
RECENT_S = 30.0
_STALLED_S = 60.0


class Remaining:
    """Told of every progress with the clock's seconds."""

    def __init__(self, started_s: float):
        self._started_s = started_s
        self._steps: deque[tuple[float, float]] = deque([(started_s, 0.0)])

    def after(self, now_s: float, fraction: float) -> str:
        """E.g. “about 40 s left”, “2 to 5 min left”, or “” while nobody can tell."""
        if fraction > self._steps[-1][1]:
            self._steps.append((now_s, fraction))
        while len(self._steps) > 2 and self._steps[1][0] < now_s - RECENT_S:
            self._steps.popleft()
        elapsed = now_s - self._started_s
        if fraction < MIN_FRACTION or elapsed < MIN_SECONDS or fraction >= 1:
            return ""
        if now_s - self._steps[-1][0] > _STALLED_S:
            return ""
        estimates = [elapsed * (1 - fraction) / fraction]
        earlier_s, earlier = self._steps[0]
        if fraction > earlier and now_s > earlier_s:
            estimates.append((now_s - earlier_s) * (1 - fraction) / (fraction - earlier))
        return _in_words(min(estimates), max(estimates))


def _in_words(low_s: float, high_s: float) -> str:
    if high_s < 1.5 * low_s:
        return f"about {_duration((low_s + high_s) / 2)} left"
    if high_s < 90:
        return f"{_tens(low_s)} to {_tens(high_s)} s left"
    low, high = max(1, round(low_s / 60)), max(2, round(high_s / 60))
    return f"{low} to {high} min left" if low < high else f"about {high} min left"


def _duration(seconds: float) -> str:
    return f"{_tens(seconds)} s" if seconds < 90 else f"{round(seconds / 60)} min"


def _tens(seconds: float) -> int:
    return max(10, 10 * round(seconds / 10))
