"""Two browsers at work and kill -9 at random moments: what was shown must be there, states equal, history whole."""

from __future__ import annotations

from pathlib import Path

from app_project import make_app_project
from crash_life import live_and_die

Row = tuple[str, str, bool]
KILLS, ACTIONS = 50, 500


def bench_crash(work: Path) -> list[Row]:
    """The one row."""
    project = make_app_project(work / "home")
    outcome = live_and_die(project.folder, kills=KILLS, actions=ACTIONS, seed=1)
    measured = (
        f"{outcome.kills} kills during {outcome.shown} actions that were shown, {outcome.steps} steps at the end; "
    )
    measured += "; ".join(outcome.lost) if outcome.lost else "nothing lost"
    is_met = not outcome.lost and outcome.kills >= KILLS and outcome.shown >= ACTIONS
    what = f"{ACTIONS} actions by two browsers, {KILLS} times kill -9: lost or different afterwards = 0"
    return [(what, measured, is_met)]
