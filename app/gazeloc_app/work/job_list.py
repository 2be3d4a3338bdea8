"""The list of jobs in the project folder, so that what the machine was doing when it was switched off is known.

PROJECT/jobs.json is replaced in one step before a job is shown as asked for, and when one ends. Only functions of
tasks.py are read back, by name: the file cannot make GazeLoc call anything else.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from gazeloc_app.door.paths import folder_inside
from gazeloc_app.state import AppState, Job
from gazeloc_app.work import tasks
from gazeloc_core import pipeline
from gazeloc_core.errors import GazelocError, ProjectError
from gazeloc_core.methods import Method
from gazeloc_core.project import Project
from gazeloc_core.storage.files import read_json, write_json_atomically

VERSION = 1
_BEGUN_BY_ITSELF = (tasks.color_scan,)
_KEY = re.compile(r"[0-9a-f]{4,64}")
"""The key of an alignment, which is a hash of its content."""


class JobList:
    """The file of one project; the caller holds the project's lock."""

    def __init__(self, project: Project, export_folder: Path, say: Callable[[str], None]):
        """Exports go on into `export_folder` and nowhere else."""
        self._path = project.folder / "jobs.json"
        self._recordings = frozenset(project.settings.recordings)
        self._export_folder = export_folder
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
            found = (_job_from_json(entry, self._recordings, self._export_folder) for entry in value["jobs"])
            return tuple(job for job in found if job is not None)
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
        Project(self._path.parent).check_is_there()
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


def _job_from_json(entry: Any, recordings: frozenset[str], export_folder: Path) -> Job | None:
    """The job of an entry; None where its task or recording is no longer there."""
    task = getattr(tasks, str(entry["task"]), None)
    if not inspect.isfunction(task) or task.__module__ != tasks.__name__ or str(entry["task"]).startswith("_"):
        return None
    keywords = {str(name): _keyword(str(name), value, export_folder) for name, value in entry["keywords"].items()}
    inspect.signature(task).bind(Path(), print, **keywords)  # a TypeError where the keywords do not fit
    if keywords.get("recording") not in recordings:
        return None
    return Job(str(entry["name"])[:80], task, tuple(keywords.items()))


def _keyword(name: str, value: Any, export_folder: Path) -> Any:
    """A keyword of a task, checked as if a browser had sent it.

    Raises:
        ValueError, InputError: if it is none that the app would have written.
    """
    if name == "method":
        return Method(value)
    if name == "formats":
        return _formats(value)
    if not isinstance(value, str):
        raise ValueError(f"{name} is {str(value)[:80]!r}")
    if name == "output":
        return str(_inside(export_folder, value))
    if name == "start" and _KEY.fullmatch(value) is None:
        raise ValueError(f"no alignment is called {value[:80]!r}")
    return value


def _formats(value: Any) -> tuple[str, ...]:
    if not isinstance(value, list) or not value or not all(one in pipeline.FORMATS for one in map(str, value)):
        raise ValueError(f"formats are {str(value)[:80]!r}")
    return tuple(map(str, value))


def _inside(root: Path, output: str) -> Path:
    """A folder in `root`, by the rules for names that browsers give."""
    path = Path(output)
    if not path.is_relative_to(root):
        raise ValueError(f"it would write to {output[:200]!r}, which is not in {root}")
    name = path.relative_to(root).as_posix()
    return folder_inside(root, "" if name == "." else name)
