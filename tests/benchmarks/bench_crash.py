"""Two pages at work and kill -9 at random moments: what was shown must be there, in both, and the history whole.

With Chromium two real pages, which come back by themselves (crash_pages.py); without one this is not measured: the same
through the app's own handlers is a test (tests/app/test_crash.py).
"""

from __future__ import annotations

from pathlib import Path

from app_project import make_app_project
from crash_pages import work_and_die
from e2e.page import chromium_path, launch
from playwright.sync_api import sync_playwright

Row = tuple[str, str, bool]
KILLS, ACTIONS = 50, 500


def bench_crash(work: Path) -> list[Row]:
    """The one row."""
    what = f"{ACTIONS} actions by two pages, {KILLS} times kill -9: lost or different afterwards = 0"
    path = chromium_path()
    if path is None:
        return [(f"{what}: not measured, no chromium is installed", "", False)]
    project = make_app_project(work / "home")
    with sync_playwright() as playwright:
        browser = launch(playwright, path)
        outcome = work_and_die(browser, project.folder, kills=KILLS, actions=ACTIONS, seed=1)
        browser.close()
    measured = f"{outcome.kills} kills during {outcome.actions} actions, {outcome.steps} steps at the end; "
    measured += "; ".join(outcome.lost) if outcome.lost else "nothing lost"
    return [(what, measured, not outcome.lost and outcome.kills >= KILLS and outcome.actions >= ACTIONS)]
