"""The list of jobs in the project folder, so that what the machine was doing when it was switched off is known.

PROJECT/jobs.json is replaced in one step before a job is shown as asked for, and when one ends. Only functions of
tasks.py are read back, by name: the file cannot make GazeLoc call anything else.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

from gazeloc_app.state import AppState, Job
from gazeloc_app.work import tasks
from gazeloc_core.errors import GazelocError, ProjectError
from gazeloc_core.files import read_json, write_json_atomically
from gazeloc_core.methods import Method
from gazeloc_core.project import Project

VERSION = 1
_BEGUN_BY_ITSELF = (tasks.color_scan,)


class JobList:
    """The file of one project; the caller holds the project's lock."""

    def __init__(self, project: Project, say: Callable[[str], None]):
        self._path = project.folder / "jobs.json"
        self._recordings = frozenset(project.settings.recordings)
        self._say = say
        self._on_disk: Any = []
        """The file's entries as far as they are known; None where they are damaged."""

    def read(self) -> tuple[Job, ...]:
        """What was under way at the end; nothing, and a sentence, where the file is damaged."""
        if not self._path.exists():
            return ()
        self._on_disk = None
        try:
            value = read_json(self._path, "the list of jobs")
            self._on_disk = value["jobs"]
            return tuple(job for entry in value["jobs"] if (job := _job_from_json(entry, self._recordings)))
        except (GazelocError, KeyError, TypeError, ValueError, AttributeError) as error:
            self._say(f"{self._path}: the list of jobs is damaged ({error}); start anew what you want done.")
            return ()

    def save(self, before: AppState, after: AppState) -> None:
        """Write the list where it differs from the file.

        Raises:
            ProjectError: if it cannot be written.
        """
        del before  # what is offered may have been read, and dismissed, within one batch of actions
        new = _to_json(after)
        if new == self._on_disk:
            return
        try:
            write_json_atomically(self._path, {"version": VERSION, "jobs": new})
            self._on_disk = new
        except OSError as error:
            raise ProjectError(
                f"{self._path}: the list of jobs could not be saved ({error.strerror}); they go on, but are not "
                "offered again if GazeLoc is ended meanwhile."
            ) from error


def _to_json(state: AppState) -> list[dict[str, Any]]:
    jobs = (job for job in (*state.offered_jobs, *state.jobs) if _is_kept(job.task))
    return [{"name": job.name, "task": job.task.__name__, "keywords": dict(job.keywords)} for job in jobs]


def _is_kept(task: Callable[..., Any]) -> bool:
    return task not in _BEGUN_BY_ITSELF and getattr(tasks, task.__name__, None) is task


def _job_from_json(entry: Any, recordings: frozenset[str]) -> Job | None:
    """The job of an entry; None where its task or recording is no longer there."""
    task = getattr(tasks, str(entry["task"]), None)
    if not inspect.isfunction(task) or task.__module__ != tasks.__name__ or str(entry["task"]).startswith("_"):
        return None
    keywords = {str(name): _keyword(str(name), value) for name, value in entry["keywords"].items()}
    inspect.signature(task).bind(Path(), print, **keywords)  # a TypeError where the keywords do not fit
    if keywords.get("recording") not in recordings:
        return None
    return Job(str(entry["name"])[:80], task, tuple(keywords.items()))


def _keyword(name: str, value: Any) -> Any:
    if name == "method":
        return Method(value)
    if isinstance(value, list):
        return tuple(str(part) for part in value)
    return str(value)
