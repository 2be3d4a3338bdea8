"""What panels say instead of which button to press, while that very work is under way."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from gazeloc_app.state import AppState


def meanwhile(state: AppState, *tasks: Callable[..., Any]) -> str:
    """A sentence while one of the tasks, or with none given any, runs or waits for the open recording; else ""."""
    for job in state.jobs:
        if job.recording == state.recording and (not tasks or job.task in tasks):
            return (
                f"“{job.name}” is at work, see the top right."
                if job is state.job
                else f"“{job.name}” is next, see the top right."
            )
    return ""
