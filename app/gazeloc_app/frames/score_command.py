"""`gazeloc score`: how well frames agree with the scan, by the function of the app's button, and which do so least."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gazeloc_app.terminal import progress_bar, table
from gazeloc_core import pipeline
from gazeloc_core.errors import InputError
from gazeloc_core.evaluation.agreement import LOW_SCORE
from gazeloc_core.frames.marks import FrameMarks
from gazeloc_core.methods import Method, method_named
from gazeloc_core.progress import part
from gazeloc_core.project import Project
from gazeloc_core.stages.poses import fresh_trajectory
from gazeloc_core.stages.scores import FrameScores
from gazeloc_core.trajectory import Trajectory

_HEAD = ("frame", "time s", "agreement", "off cm", "±", "off °", "±", "scan off cm", "pose", "mark", "")


@dataclass(frozen=True, eq=False)
class _Scored:
    """The scores of one recording by one method, its poses and what people said."""

    recording: str
    method: Method
    scores: FrameScores
    trajectory: Trajectory
    marks: FrameMarks

    def worst(self, count: int) -> list[int]:
        """The frames that have a score, the lowest first."""
        order = np.argsort(self.scores.score, kind="stable")  # NaN goes to the end
        return [int(frame) for frame in order[: min(count, len(self.scores.known))]]


def score(folder: Path, *, method: str | None, recording: str | None, worst: int, as_json: bool) -> None:
    """Score the frames of one recording or all with a progress bar, and print a summary and the worst frames."""
    if worst < 0:
        raise InputError(f"--worst {worst}: this is how many frames to list; give 0 or more.")
    project, how = Project.open(folder), None if method is None else method_named(method)
    names = list(project.settings.recordings) if recording is None else [recording]
    found = []
    with project.lock(), progress_bar() as report:
        for number, name in enumerate(names):
            share = part(report, number / len(names), (number + 1) / len(names))
            project.recording(name)
            by = how or project.method(name)
            scores = pipeline.score(project, name, by, share)
            found.append(_Scored(name, by, scores, fresh_trajectory(project, name, by), project.marks(name)))
    if as_json:
        values = {one.recording: {one.method: _json(one, worst)} for one in found}
        print(json.dumps(values, indent=1, allow_nan=False))
        return
    head = ["recording", "method", "frames", "with a pose", "scored", "median", f"below {LOW_SCORE:g}"]
    print(table(head, [_summary(one) for one in found]))
    for one in found:
        if frames := one.worst(worst):
            print(f"\n{one.recording}, {one.method}: the frames that agree least")
            print(table(_HEAD, _rows(one, frames)))


def _summary(one: _Scored) -> list[str]:
    known = one.scores.known
    median = f"{np.median(known):.2f}" if len(known) else "–"
    counts = (len(one.trajectory), int(one.trajectory.has_pose.sum()), len(known))
    return [one.recording, one.method, *map(str, counts), median, str(int((known < LOW_SCORE).sum()))]


def _rows(one: _Scored, frames: list[int]) -> list[list[str]]:
    times, rows = one.trajectory.timestamp_ns, []
    for frame in frames:
        mark = one.marks.get(frame)
        rows.append(
            [
                str(frame),
                f"{(int(times[frame]) - int(times[0])) / 1e9:.2f}",
                f"{one.scores.score[frame]:.2f}",
                _cell(100 * one.scores.shift_m[frame], 1),
                _cell(100 * one.scores.shift_sigma_m[frame], 1),
                _cell(one.scores.turn_deg[frame], 2),
                _cell(one.scores.turn_sigma_deg[frame], 2),
                _cell(100 * one.scores.scan_shift_m[frame], 1),
                str(one.trajectory.status[frame]),
                "" if mark is None else mark.mark.value,
                "" if mark is None else mark.note,
            ]
        )
    return rows


def _cell(value: float, digits: int) -> str:
    """A number, or a dash where it cannot be told."""
    return f"{value:.{digits}f}" if np.isfinite(value) else "–"


def _or_none(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _json(one: _Scored, worst: int) -> dict[str, Any]:
    known, columns = one.scores.known, asdict(one.scores)
    return {
        "frames": len(one.trajectory),
        "with_a_pose": int(one.trajectory.has_pose.sum()),
        "scored": len(known),
        "median": float(np.median(known)) if len(known) else None,
        "low": int((known < LOW_SCORE).sum()),
        "worst": [
            {
                "frame_index": frame,
                "timestamp_ns": int(one.trajectory.timestamp_ns[frame]),
                **{name: _or_none(values[frame]) for name, values in columns.items()},
            }
            for frame in one.worst(worst)
        ],
    }
