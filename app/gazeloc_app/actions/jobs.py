"""Long work: asked for, getting on, cancelled, ended; and what was under way when GazeLoc ended the last time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from gazeloc_app.state import AppState, EndedJob, Job, Level, Notice, SuggestedAlignment

MAX_WAITING = 20
MAX_LOG_LINES = 12
_MAX_ENDED = 8


@dataclass(frozen=True)
class StartJob:
    """The user asked for long work: `task` of tasks.py with its keywords. One at a time, the others wait in order."""

    name: str
    task: Callable[..., Any]
    keywords: tuple[tuple[str, Any], ...] = ()

    def apply(self, state: AppState) -> AppState:
        """The state with the job, which an effect then starts; the same work is not queued twice."""
        number = state.jobs_started + 1
        job = Job(self.name, self.task, self.keywords, number=number)
        if any(job.is_same_work(other) for other in state.jobs):
            return state.noticed(Level.INFO, f"“{state.job_title(job)}” is under way already.")
        if len(state.waiting_jobs) >= MAX_WAITING:
            return state.noticed(Level.WARNING, f"{MAX_WAITING} jobs wait already; let some end first.")
        offered = tuple(other for other in state.offered_jobs if not job.is_same_work(other))
        state = replace(state, jobs_started=number, offered_jobs=offered)
        if state.job is None:
            return replace(state, job=job, notice=None)
        state = replace(state, waiting_jobs=(*state.waiting_jobs, job))
        after = state.job_title(state.jobs[-2])
        return state.noticed(Level.INFO, f"“{state.job_title(job)}” begins after “{after}”.")


@dataclass(frozen=True)
class JobProgressed:
    """Long work got on; `line` is new in its log."""

    fraction: float
    text: str
    remaining: str = ""
    line: str | None = None

    def apply(self, state: AppState) -> AppState:
        """The state with the progress."""
        if state.job is None:
            return state
        log = state.job.log if self.line is None else (*state.job.log, self.line)[-MAX_LOG_LINES:]
        job = replace(state.job, fraction=self.fraction, text=self.text, remaining=self.remaining, log=log)
        return replace(state, job=job)


@dataclass(frozen=True)
class CancelJob:
    """The user wants a job to stop, by its number: what runs is asked to (by an effect), what waits is forgotten."""

    number: int

    def apply(self, state: AppState) -> AppState:
        """The state that says so."""
        if state.job is not None and state.job.number == self.number:
            return replace(state, job=replace(state.job, is_cancelling=True))
        dropped = next((job for job in state.waiting_jobs if job.number == self.number), None)
        if dropped is None:
            return state
        state = replace(state, waiting_jobs=tuple(job for job in state.waiting_jobs if job is not dropped))
        return state.noticed(Level.INFO, f"“{state.job_title(dropped)}” was taken off the list.")


@dataclass(frozen=True)
class JobEnded:
    """Long work ended, well or not; `alignment` is the one it suggests to put in force."""

    level: Level
    text: str
    alignment: str | None = None
    by_person: bool = False

    def apply(self, state: AppState) -> AppState:
        """The state with the next job, the news of this one and its alignment (which can be undone).

        Nothing changes that is shown where the job was about another recording than the one that is open.
        """
        ended, job = state.ended_jobs, state.job
        recording = state.recording if job is None or job.recording is None else job.recording
        text = self.text if recording == state.recording else f"{recording}: {self.text}"
        if job is not None:
            ended = (EndedJob(job.name, Notice(self.level, self.text), job.log, job.number, job.recording), *ended)
        state = replace(
            state,
            job=state.waiting_jobs[0] if state.waiting_jobs else None,
            waiting_jobs=state.waiting_jobs[1:],
            ended_jobs=ended[:_MAX_ENDED],
            data_revision=state.data_revision + 1,
        )
        if self.alignment is not None:
            state = _suggest(state, SuggestedAlignment(recording, self.alignment, self.by_person))
        return state.noticed(self.level, text)


def _suggest(state: AppState, suggested: SuggestedAlignment) -> AppState:
    if suggested.recording == state.recording:
        return state.annotate(state.annotation.with_suggested(suggested))
    others = tuple(other for other in state.suggested if other.recording != suggested.recording)
    return replace(state, suggested=(*others, suggested))


@dataclass(frozen=True)
class OfferJobs:
    """These were under way when GazeLoc ended the last time."""

    jobs: tuple[Job, ...]

    def apply(self, state: AppState) -> AppState:
        """The state that offers them."""
        return replace(state, offered_jobs=self.jobs)


@dataclass(frozen=True)
class ResumeJobs:
    """The user wants to go on with what was under way."""

    def apply(self, state: AppState) -> AppState:
        """The state with all offered jobs begun or waiting."""
        for job in state.offered_jobs:
            state = StartJob(job.name, job.task, job.keywords).apply(state)
        return state


@dataclass(frozen=True)
class DismissJobs:
    """The user does not want to go on with what was under way."""

    def apply(self, state: AppState) -> AppState:
        """The state without the offer."""
        return replace(state, offered_jobs=())
