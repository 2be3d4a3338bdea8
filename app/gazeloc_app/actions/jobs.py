"""Long work: asked for, getting on, ended."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from gazeloc_app.state import AppState, Job, Level


@dataclass(frozen=True)
class StartJob:
    """The user asked for long work: `task` of tasks.py with its keywords. One piece at a time."""

    name: str
    task: Callable[..., Any]
    keywords: tuple[tuple[str, Any], ...] = ()

    def apply(self, state: AppState) -> AppState:
        """The state with the job, which an effect then starts; refused while another is under way."""
        if state.job is not None:
            return state.noticed(Level.WARNING, f"“{state.job.name}” is still running; wait for it or cancel it.")
        number = state.jobs_started + 1
        job = Job(self.name, self.task, self.keywords, number=number)
        return replace(state, job=job, jobs_started=number, notice=None)


@dataclass(frozen=True)
class JobProgressed:
    """Long work got on."""

    fraction: float
    text: str

    def apply(self, state: AppState) -> AppState:
        """The state with the progress."""
        return (
            state
            if state.job is None
            else replace(state, job=replace(state.job, fraction=self.fraction, text=self.text))
        )


@dataclass(frozen=True)
class JobCancelling:
    """The user asked running work to stop."""

    def apply(self, state: AppState) -> AppState:
        """The state that says so."""
        return state if state.job is None else replace(state, job=replace(state.job, is_cancelling=True))


@dataclass(frozen=True)
class JobEnded:
    """Long work ended, well or not; `alignment` is the one it suggests to put in force."""

    level: Level
    text: str
    alignment: str | None = None
    by_person: bool = False

    def apply(self, state: AppState) -> AppState:
        """The state without the job, with its news and its alignment (which can be undone).

        An alignment that a run suggests never replaces one that a person chose.
        """
        state = replace(state, job=None, data_revision=state.data_revision + 1)
        is_free = self.by_person or not state.annotation.alignment_by_person
        if is_free and self.alignment is not None and self.alignment != state.annotation.alignment:
            chosen = replace(state.annotation, alignment=self.alignment, alignment_by_person=self.by_person)
            state = state.annotate(chosen)
        return state.noticed(self.level, self.text)
