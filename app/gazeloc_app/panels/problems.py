"""Panel: the frames worst first, or those that people marked, with small pictures; a click goes to a frame."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from urllib.parse import quote

import numpy as np
from viser import GuiApi

from gazeloc_app import widgets
from gazeloc_app.actions.action import Action
from gazeloc_app.actions.jobs import StartJob
from gazeloc_app.data import FrameErrors, ProjectData
from gazeloc_app.frames.offset_text import short_offset_text
from gazeloc_app.frames.problems import FrameTable, Problem, worst_first
from gazeloc_app.frames.timeline_html import MARK_SIGNS
from gazeloc_app.panels.meanwhile import meanwhile
from gazeloc_app.panels.playing import table_of
from gazeloc_app.state import AppState
from gazeloc_app.work import tasks
from gazeloc_core.evaluation.evaluate import errors_by_mark
from gazeloc_core.frames.marks import FrameMarks, Mark
from gazeloc_core.stages.scores import FrameScores

_MOST = 40
_FIRST = "“Score the frames” compares each with the scan seen from its pose."
_NOTHING = {
    "lowest score first": "No frame has a low score.",
    "marked bad": "No frame is marked bad: the key B marks the one that is shown.",
    "marked unsure": "No frame is marked unsure: the key U marks the one that is shown.",
    "marked good": "No frame is marked good: the key G marks the one that is shown.",
    "without a pose": "Every frame has a pose.",
}

_COUNTED = {
    Problem.BAD: "marked bad",
    Problem.UNSURE: "marked unsure",
    Problem.NO_POSE: "without a pose",
    Problem.LOW_SCORE: "with a low score",
}


class Which(StrEnum):
    """Which frames the list has."""

    WORST = "lowest score first"
    BAD = "marked bad"
    UNSURE = "marked unsure"
    GOOD = "marked good"
    NO_POSE = "without a pose"


class ProblemPanel:
    """The button that scores, how many frames have which problem, and the list."""

    def __init__(self, gui: GuiApi, data: ProjectData, dispatch: Callable[[Action], None]):
        self._data, self._dispatch = data, dispatch
        self._state: AppState | None = None
        self._seen: object = None
        self._score = gui.add_button(
            "Score the frames",
            hint="How well each frame agrees with the scan seen from its pose; goes on where it was.",
        )
        self._summary = gui.add_html("")
        self._which = gui.add_dropdown(
            "Frames", tuple(Which), initial_value=Which.WORST, hint="Which frames the list holds."
        )
        self._list = gui.add_html("")
        widgets.on_user(self._score, lambda _: self._start(), event="on_click")
        widgets.on_user(self._which, lambda _: self._render_list())

    def render(self, state: AppState) -> None:
        """Show the state's frames."""
        self._state = state
        widgets.set_property(self._score, "disabled", state.has_job("Score the frames"))
        key = self._data.poses_key(state.recording, state.annotation)
        at_work = meanwhile(state, tasks.score_frames)
        seen = (state.recording, key, state.data_revision, state.annotation.marks, at_work)
        if seen != self._seen:
            self._seen = seen
            self._render_list()

    def _render_list(self) -> None:
        state = self._state
        if state is None:
            return
        table = table_of(self._data, state)
        key = self._data.poses_key(state.recording, state.annotation)
        errors, scores = self._data.errors(state.recording, key), self._data.frame_scores(state.recording, key)
        how = meanwhile(state, tasks.score_frames) or _FIRST
        widgets.set_content(self._summary, widgets.box(_summary_html(table, state.annotation.marks, errors, how)))
        frames = self._frames(table, state.annotation.marks)
        rows = "".join(_row(state, table, scores, errors, frame) for frame in frames[:_MOST])
        if len(frames) > _MOST:
            rows += f"<div>and {len(frames) - _MOST} more</div>"
        nothing = self._nothing(table)
        widgets.set_content(self._list, widgets.box(f'<div class="gazeloc-frames">{rows}</div>' if rows else nothing))

    def _frames(self, table: FrameTable, marks: FrameMarks) -> list[int]:
        which = str(self._which.value)
        if which == Which.NO_POSE:
            return [int(frame) for frame in np.flatnonzero(~table.has_pose)]
        by_mark = {Which.BAD: Mark.BAD, Which.UNSURE: Mark.UNSURE, Which.GOOD: Mark.GOOD}
        if which in tuple(by_mark):
            wanted = by_mark[Which(which)]
            return [one.frame_index for one in marks.marks if one.mark is wanted and one.frame_index < len(table.score)]
        return worst_first(table)

    def _nothing(self, table: FrameTable) -> str:
        """A sentence for a list without frames; "" where the summary says it already."""
        which = Which(str(self._which.value))
        return "" if which is Which.WORST and not np.isfinite(table.score).any() else _NOTHING[which]

    def _start(self) -> None:
        if self._state is not None:
            keywords = (("recording", self._state.recording), ("method", self._state.annotation.method))
            self._dispatch(StartJob("Score the frames", tasks.score_frames, keywords))


def _summary_html(table: FrameTable, marks: FrameMarks, errors: FrameErrors | None, how: str) -> str:
    known = table.score[np.isfinite(table.score)]
    scored = widgets.card("Nothing is scored yet.", how)
    if len(known):
        scored = f"{len(known)} frames are scored, the median agreement is {np.median(known):.2f} of 1."
    counts = [(int((table.problem == kind.value).sum()), words) for kind, words in _COUNTED.items()]
    problems = ", ".join(f"{count} {words}" for count, words in counts if count) or "none found"
    found = {} if errors is None else errors_by_mark(marks, errors.rotation_deg, errors.position_m)
    marked = [
        f"{count} {mark.value}" + (f" (mean error {100 * found[mark].position_m.mean:.1f} cm)" if mark in found else "")
        for mark, count in marks.counts().items()
    ]
    return f"{scored}<div>Problems: {problems}.</div><div>Marks: {', '.join(marked)}.</div>"


def _row(state: AppState, table: FrameTable, scores: FrameScores | None, errors: FrameErrors | None, frame: int) -> str:
    facts = [f"<b>Frame {frame}</b>"]
    if scores is not None and np.isfinite(scores.score[frame]):
        facts.append(f"agreement {scores.score[frame]:.2f}, looks {short_offset_text(scores, frame)}")
    if errors is not None and np.isfinite(errors.position_m[frame]):
        facts.append(f"error {100 * errors.position_m[frame]:.1f} cm, {errors.rotation_deg[frame]:.2f}°")
    if not table.has_pose[frame]:
        facts.append("no pose")
    found = state.annotation.marks.get(frame)
    if found is not None:
        facts.append(widgets.colored(f"{MARK_SIGNS[found.mark]} {found.mark}", widgets.MARK_COLORS[found.mark]))
        facts.append(widgets.text(found.note))
    url = widgets.text(f"/show/{quote(state.recording)}/{frame}")
    picture = widgets.text(f"/thumbnails/{quote(state.recording)}/{frame}.jpg?rev=1")
    return (
        f'<a data-url="{url}" onclick="gazelocTimeline.show(this.dataset.url)">'
        f'<img alt="" loading="lazy" src="{picture}"><span>{" · ".join(fact for fact in facts if fact)}</span></a>'
    )
