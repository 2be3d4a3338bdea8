"""Tasks of tests for the worker process; the worker imports them by name."""

import os
import time
from pathlib import Path

from gazeloc_app.state import Level
from gazeloc_app.work import tasks
from gazeloc_app.work.outcome import Outcome

from gazeloc_core.errors import InputError
from gazeloc_core.progress import Report

GO = "go"
"""The file that lets `align_when_told` begin."""


def succeed(folder: Path, report: Report, *, alignment: str) -> Outcome:
    report(1.0, "almost")
    return Outcome(f"Done in {folder.name}.", Level.WARNING, alignment=alignment, by_person=True)


def step(folder: Path, report: Report) -> Outcome:
    """Write, then work until asked to stop."""
    for i in range(600):
        report(i / 600, f"step {i}")
        (folder / "steps.txt").write_text(str(i))
        time.sleep(0.05)
    return Outcome("Nobody stopped this.")


def name_bad_input(folder: Path, report: Report) -> Outcome:
    raise InputError.of(folder / "scan.obj", "the file is empty", "export it again")


def stumble(folder: Path, report: Report) -> Outcome:
    raise ZeroDivisionError("a fault of ours")


def die(folder: Path, report: Report) -> Outcome:
    os._exit(7)


def say_pid(folder: Path, report: Report) -> Outcome:
    return Outcome(str(os.getpid()))


def be_deaf(folder: Path, report: Report) -> Outcome:
    report(0.5, "not listening")
    (folder / "deaf.pid").write_text(str(os.getpid()))
    time.sleep(600)
    return Outcome("Never.")


def align_when_told(folder: Path, report: Report, *, recording: str) -> Outcome:
    """The app's alignment, held back until somebody writes `go` into the project."""
    while not (folder / GO).exists():
        report(0.1, "held back")
        time.sleep(0.05)
    return tasks.align(folder, report, recording=recording)
