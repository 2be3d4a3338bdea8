"""What the state says about the job brought to the process that does it: begun, and cancelled."""

from __future__ import annotations

from collections.abc import Callable

from gazeloc_app.actions.action import Action
from gazeloc_app.actions.jobs import JobEnded
from gazeloc_app.state import AppState, Level
from gazeloc_app.work.jobs import JobRunner


class JobStarter:
    """An effect of the store."""

    def __init__(self, runner: JobRunner, dispatch: Callable[[Action], None], has_unsaved: Callable[[], bool]):
        """`has_unsaved()`: whether something that people decided is not in the files that jobs read."""
        self._runner, self._dispatch, self._has_unsaved = runner, dispatch, has_unsaved
        self._last = 0
        """The number of the job that was begun last."""

    def __call__(self, before: AppState, after: AppState) -> None:
        """Begin the state's job where it is another one, or cancel it where the state wants that."""
        del before
        job = after.job
        if job is None:
            return
        if job.number != self._last:
            self._last = job.number
            if self._has_unsaved():
                text = f"“{job.name}” was not begun: it reads the project's files, and those could not be saved."
                self._dispatch(JobEnded(Level.ERROR, text))
                return
            self._runner.start(job.name, job.task, **dict(job.keywords))
        if job.is_cancelling:
            self._runner.cancel()
