"""What a task of the worker process tells the app at its end, and what a task is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from gazeloc_app.state import Level


@dataclass(frozen=True)
class Outcome:
    """What a task tells the app at its end: a sentence, and the alignment it suggests to put in force."""

    text: str
    level: Level = Level.INFO
    alignment: str | None = None
    by_person: bool = False


Task = Callable[..., Outcome]
"""`task(folder, report, **keywords)`, importable by name in the worker."""
