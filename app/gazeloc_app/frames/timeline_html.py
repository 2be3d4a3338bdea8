"""The timeline as HTML: a strip of how the frames came by their poses, marks, score and error; a click goes there.

The page's half (static/page/timeline.js and .css) turns a click into the frame and keeps the cursor.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gazeloc_app.palette import ERROR, MARKS, SCORE, STATUSES, hexadecimal, meaning
from gazeloc_core.arrays import Floats, Ints
from gazeloc_core.evaluation.agreement import LOW_SCORE
from gazeloc_core.frames.marks import FrameMarks, Mark
from gazeloc_core.trajectory import PoseStatus, Trajectory

PARTS = 400
"""A longer recording is drawn in this many parts, each with its worst frame."""
_WORST_FIRST = ("rejected", "none", "tag_only", "interpolated", "tracked", "registered")
STATUS_COLORS = {status.value: hexadecimal(color) for status, color in STATUSES.items()}
STATUS_NAMES = {
    PoseStatus.REGISTERED.value: "registered",
    PoseStatus.TRACKED.value: "tracked",
    PoseStatus.INTERPOLATED.value: "interpolated",
    PoseStatus.TAG_ONLY.value: "tag only",
    PoseStatus.REJECTED.value: "rejected",
    PoseStatus.NONE.value: "no pose",
}
MARK_COLORS = {mark: hexadecimal(color) for mark, color in MARKS.items()}
MARK_SIGNS = {Mark.GOOD: "✓", Mark.BAD: "✗", Mark.UNSURE: "?"}


def timeline_html(trajectory: Trajectory | None, score: Floats, error_m: Floats | None, marks: FrameMarks) -> str:
    """The whole timeline of a recording of N frames; `score` (N,) and `error_m` (N,) are NaN where there is none."""
    count = len(score)
    status = np.full(count, PoseStatus.NONE.value) if trajectory is None else trajectory.status
    rows = [_strip(status), _mark_ticks(marks, count)]
    legend = [
        f'<i style="background:{STATUS_COLORS[name]}"></i>{STATUS_NAMES[name]} {int((status == name).sum())}'
        for name in STATUS_NAMES
        if (status == name).any()
    ]
    if np.isfinite(score).any():
        rows.append(_curve(score, 1.0, hexadecimal(SCORE), limit=LOW_SCORE))
        legend.append(f'<i style="background:{hexadecimal(SCORE)}"></i>agreement 0–1, dashed {LOW_SCORE:g}')
    if error_m is not None and np.isfinite(error_m).any():
        top = max(float(np.nanpercentile(error_m, 98)), 1e-6)
        rows.append(_curve(-error_m, 0.0, hexadecimal(ERROR), low=-top))
        legend.append(f'<i style="background:{hexadecimal(ERROR)}"></i>error 0–{100 * top:.1f} cm ↓')
    return (
        f'<div class="gazeloc-timeline" data-last="{count - 1}"'
        ' onpointerdown="gazelocTimeline.go(event)" onpointermove="gazelocTimeline.drag(event)"'
        f' title="Click to go to a frame">{"".join(rows)}<b></b>'
        '<img alt="" src="data:," style="display:none" onerror="gazelocScrub.ready()"></div>'
        f'<div class="gazeloc-legend">{" ".join(f"<span>{item}</span>" for item in legend)}</div>'
    )


def _strip(status: NDArray[np.str_]) -> str:
    """A bar in runs of one colour; a part of several frames has that of its worst, or of most if all are measured."""
    rank = np.array([_WORST_FIRST.index(str(name)) for name in status])
    worst = np.array([_of_part(part) for part in np.array_split(rank, min(len(rank), PARTS))])
    edges = np.concatenate([[0], np.flatnonzero(np.diff(worst)) + 1, [len(worst)]])
    stops = ",".join(
        f"{STATUS_COLORS[_WORST_FIRST[worst[a]]]} {100 * a / len(worst):.2f}% {100 * b / len(worst):.2f}%"
        for a, b in pairwise(edges.tolist())
    )
    return f'<div style="height:10px;background:linear-gradient(90deg,{stops})"></div>'


def _of_part(rank: Ints) -> int:
    """The place in `_WORST_FIRST` that stands for some frames (K,): tracked ones are no worse than registered ones."""
    tracked, registered = len(_WORST_FIRST) - 2, len(_WORST_FIRST) - 1
    if rank.min() < tracked:
        return int(rank.min())
    return registered if 2 * (rank == registered).sum() >= len(rank) else tracked


def _mark_ticks(marks: FrameMarks, count: int) -> str:
    ticks = "".join(
        f'<u style="left:{100 * one.frame_index / max(count - 1, 1):.2f}%;background:{MARK_COLORS[one.mark]}"></u>'
        for one in marks.marks
        if one.frame_index < count
    )
    return f'<div style="height:8px">{ticks}</div>'


def _curve(values: Floats, high: float, color: str, *, low: float = 0.0, limit: float | None = None) -> str:
    """The lowest value of each part as a line from `low` to `high`, broken where nothing is known."""
    parts = np.array_split(values, min(len(values), PARTS))
    lowest = np.array([np.nanmin(part) if np.isfinite(part).any() else np.nan for part in parts])
    y = 29 - 28 * np.clip((lowest - low) / max(high - low, 1e-12), 0, 1)
    pieces, pen_is_down = [], False
    for x, at in enumerate(y):
        if np.isfinite(at):
            pieces.append(f"{'L' if pen_is_down else 'M'}{x + 0.5:g} {at:.1f}h.01")
        pen_is_down = bool(np.isfinite(at))
    dashed = ""
    if limit is not None:
        style = f'style="stroke:{meaning("muted")}" stroke-dasharray="4"'
        dashed = f'<path d="M0 {29 - 28 * limit:.1f}H{len(y)}" {style}/>'
    return (
        f'<svg viewBox="0 0 {len(y)} 30" preserveAspectRatio="none">{dashed}'
        f'<path d="{"".join(pieces)}" stroke="{color}" fill="none"/></svg>'
    )
