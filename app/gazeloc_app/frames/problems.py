"""Which frames deserve a look: those without a pose, with a low score, or that a person marked bad or unsure."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from gazeloc_core.arrays import Bools, Floats
from gazeloc_core.evaluation.agreement import LOW_SCORE
from gazeloc_core.frames.marks import FrameMarks, Mark
from gazeloc_core.trajectory import Trajectory


class Problem(StrEnum):
    """Why a frame deserves a look; `NONE` where it does not."""

    NONE = ""
    BAD = "marked bad"
    UNSURE = "marked unsure"
    NO_POSE = "no pose"
    LOW_SCORE = "low score"


@dataclass(frozen=True, eq=False)
class FrameTable:
    """What is known about each of the N frames: `has_pose` (N,), `score` (N,), `problem` (N,) of `Problem` values."""

    has_pose: Bools
    score: Floats
    problem: NDArray[np.str_]


def frame_table(count: int, trajectory: Trajectory | None, score: Floats, marks: FrameMarks) -> FrameTable:
    """The table of a recording of `count` frames; a frame that a person marked good is no problem."""
    has_pose = np.zeros(count, np.bool_) if trajectory is None else np.asarray(trajectory.has_pose)
    problem = np.full(count, Problem.NONE.value, dtype="U16")
    with np.errstate(invalid="ignore"):
        problem[score < LOW_SCORE] = Problem.LOW_SCORE.value
    problem[~has_pose] = Problem.NO_POSE.value
    told = {Mark.GOOD: Problem.NONE, Mark.BAD: Problem.BAD, Mark.UNSURE: Problem.UNSURE}
    for one in marks.marks:
        if one.frame_index < count:
            problem[one.frame_index] = told[one.mark].value
    return FrameTable(has_pose, score, problem)


def next_problem(table: FrameTable, frame: int, step: int = 1) -> int | None:
    """The frame at which the next (`step` 1) or the previous (-1) problem begins, around the end; None without any.

    Neighbours with one and the same problem are one problem: a second without poses is gone to once.
    """
    problem = table.problem
    before = np.concatenate([[""], problem[:-1]])
    starts = np.flatnonzero((problem != "") & (problem != before))
    if len(starts) == 0:
        return None
    ahead = starts[starts > frame] if step > 0 else starts[starts < frame][::-1]
    return int(ahead[0]) if len(ahead) else int(starts[0] if step > 0 else starts[-1])


def worst_first(table: FrameTable) -> list[int]:
    """The frames that have a score, the lowest first."""
    known = np.flatnonzero(np.isfinite(table.score))
    return [int(frame) for frame in known[np.argsort(table.score[known], kind="stable")]]
