"""After a run, the frames are scored in the background: people then see at once where to look."""

from __future__ import annotations

from collections.abc import Callable

from gazeloc_app.actions.action import Action
from gazeloc_app.actions.jobs import StartJob
from gazeloc_app.state import AppState, Level
from gazeloc_app.work import tasks


class ScoreAfterRun:
    """An effect of the store."""

    def __init__(self, dispatch: Callable[[Action], None]):
        self._dispatch = dispatch

    def __call__(self, before: AppState, after: AppState) -> None:
        """Ask for the scores where a run of all stages has just ended well."""
        job = before.job
        if job is None or job.task is not tasks.run_all or job.is_cancelling:
            return
        ended = next((ended for ended in after.ended_jobs if ended.number == job.number), None)
        is_new = ended is not None and ended not in before.ended_jobs
        if ended is not None and is_new and ended.notice.level is Level.INFO:
            self._dispatch(StartJob("Score the frames", tasks.score_frames, job.keywords))
