"""Long work in a process of its own, one piece at a time, with progress, a log and cancel.

Open3D and pycolmap hold Python's GIL for seconds, and a crash of theirs takes the process along; in here neither can
freeze or end the app. The worker starts once (its imports take seconds) and again after it died. Cancel asks first
(`report` raises `Cancelled` at the next progress), and ends the process if that takes longer than `PATIENCE_S`.
Artifacts are written beside their place and renamed, so they survive either.
"""

from __future__ import annotations

import importlib
import logging
import multiprocessing
import os
import threading
import time
import traceback
from collections.abc import Callable
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

from gazeloc_app.actions.action import Action
from gazeloc_app.actions.jobs import JobEnded, JobProgressed
from gazeloc_app.state import Level
from gazeloc_app.work.job_log import JobLog
from gazeloc_app.work.outcome import Task
from gazeloc_app.work.remaining import Remaining
from gazeloc_core.errors import Cancelled, GazelocError
from gazeloc_core.progress import Report

_log = logging.getLogger(__name__)
PATIENCE_S = 5.0
_REPORT_INTERVAL_S = 0.1


class JobRunner:
    """Runs one task at a time for the project in `folder` and tells the store by actions."""

    def __init__(self, folder: Path, dispatch: Callable[[Action], None]):
        self._folder = folder
        self._dispatch = dispatch
        self._busy = threading.Lock()
        self._starting = threading.Lock()
        self._context = multiprocessing.get_context("spawn")
        self._cancel: Any = self._context.RawValue("b", 0)
        """1 once the running task is asked to stop. A byte and no Event: an Event has a lock, which a worker that is
        killed while it looks would keep for ever."""
        self._process: BaseProcess | None = None
        self._connection: Connection | None = None

    def warm_up(self) -> None:
        """Start the worker process now, so that the first task need not wait for its imports."""
        self._worker()

    def start(self, name: str, task: Task, **keywords: Any) -> None:
        """Begin a task; the store sees to it that there is one at a time."""
        if not self._busy.acquire(blocking=False):
            raise RuntimeError("a job is under way")
        self._cancel.value = 0
        threading.Thread(target=self._watch, args=(name, task, keywords), name="gazeloc-job", daemon=True).start()

    def cancel(self) -> None:
        """Ask the running task to stop; it is ended if it does not answer in time."""
        if self._busy.locked():
            self._cancel.value = 1

    def stop(self) -> None:
        """End the worker process."""
        process, self._process = self._process, None
        if process is not None and process.is_alive():
            process.kill()
            process.join()

    def _watch(self, name: str, task: Task, keywords: dict[str, Any]) -> None:
        job_log = JobLog(self._folder, name)
        job_log.add(f"{name} begins.")
        try:
            ended = self._run(name, task, keywords, job_log)
        except (OSError, EOFError):
            self.stop()
            ended = self._died(name)
        except Exception as error:  # the next job must be able to run, whatever a bug of ours does to this one
            _log.exception("watching the job %s", name)
            self.stop()
            ended = JobEnded(Level.ERROR, f"A fault in GazeLoc stopped this: {type(error).__name__}: {error}.")
        finally:
            self._busy.release()
        job_log.add(f"{ended.level.value}: {ended.text}")
        self._dispatch(ended)

    def _run(self, name: str, task: Task, keywords: dict[str, Any], job_log: JobLog) -> JobEnded:
        connection = self._worker()
        connection.send((task, keywords))
        remaining = Remaining(time.monotonic())
        asked_at: float | None = None
        while True:
            if connection.poll(0.1):
                kind, value = connection.recv()
                if kind == "progress":
                    fraction, text = value
                    left, line = remaining.after(time.monotonic(), fraction), job_log.add(text, fraction)
                    self._dispatch(JobProgressed(fraction, text, left, line))
                elif kind == "done":
                    return JobEnded(value.level, value.text, value.alignment, value.by_person)
                elif kind == "cancelled":
                    return JobEnded(Level.INFO, f"“{name}” was cancelled; what was there before is unchanged.")
                else:
                    return JobEnded(Level.ERROR, value)
            if self._cancel.value:
                asked_at = asked_at or time.monotonic()
                if time.monotonic() - asked_at > PATIENCE_S:
                    self.stop()
                    return JobEnded(Level.INFO, f"“{name}” was ended; what was there before is unchanged.")
            process = self._process
            if (process is None or not process.is_alive()) and not connection.poll():
                raise EOFError

    def _died(self, name: str) -> JobEnded:
        if self._cancel.value:
            return JobEnded(Level.INFO, f"“{name}” was ended; what was there before is unchanged.")
        return JobEnded(
            Level.ERROR,
            f"“{name}” ended without an answer (its process died, perhaps for want of memory); "
            "what was there before is unchanged, try it again.",
        )

    def _worker(self) -> Connection:
        with self._starting:
            if self._process is None or not self._process.is_alive() or self._connection is None:
                ours, theirs = self._context.Pipe()
                arguments = (theirs, self._cancel, self._folder, os.getpid())
                self._process = self._context.Process(target=_serve, args=arguments, name="gazeloc-jobs", daemon=True)
                self._process.start()
                theirs.close()
                self._connection = ours
            return self._connection


def _serve(connection: Connection, cancel: Any, folder: Path, parent: int) -> None:
    if hasattr(os, "nice"):
        os.nice(5)  # scrubbing through frames goes first
    importlib.import_module("gazeloc_app.work.tasks")  # takes seconds: now, not when the first task comes
    report = _report_to(connection, cancel, parent)
    while True:
        try:
            task, keywords = connection.recv()
        except (EOFError, OSError):
            return
        answer = _answer(task, folder, report, keywords)
        try:
            connection.send(answer)
        except OSError:  # the app is gone
            return


def _answer(task: Task, folder: Path, report: Report, keywords: dict[str, Any]) -> tuple[str, Any]:
    try:
        return "done", task(folder, report, **keywords)
    except Cancelled:
        return "cancelled", None
    except GazelocError as error:
        return "failed", str(error)
    except Exception as error:
        traceback.print_exc()
        return "failed", f"A fault in GazeLoc stopped this: {type(error).__name__}: {error}."


def _report_to(connection: Connection, cancel: Any, parent: int) -> Report:
    last = [0.0]

    def report(fraction: float, text: str = "", /) -> None:
        if cancel.value or os.getppid() != parent:
            raise Cancelled("Cancelled.")
        now = time.monotonic()
        if now - last[0] > _REPORT_INTERVAL_S or fraction >= 1:
            last[0] = now
            connection.send(("progress", (float(min(max(fraction, 0), 1)), text)))

    return report
