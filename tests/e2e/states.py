"""Pictures of states that are seldom seen, to be looked at: python tests/e2e/states.py OUT

A small made-up room without a recording, without tags and a ground truth, while a job runs with another waiting, after
one failed, with a keypoint under the loupe and two people, and after the app has ended.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TESTS), str(TESTS.parent), str(TESTS.parent / "app")]

from app_project import make_app_project  # noqa: E402
from e2e.app_page import AppPage  # noqa: E402
from e2e.page import ViewerPage, chromium_path, launch  # noqa: E402
from gazeloc_app.actions.jobs import JobEnded, JobProgressed, StartJob  # noqa: E402
from gazeloc_app.actions.picks import PickPoint, Side  # noqa: E402
from gazeloc_app.app import App  # noqa: E402
from gazeloc_app.state import Level  # noqa: E402
from gazeloc_app.work import tasks  # noqa: E402
from playwright.sync_api import Browser, sync_playwright  # noqa: E402

from gazeloc_core.project import Project  # noqa: E402

SIZE = {"width": 1280, "height": 800}
REST_MS = 1500
WALK = (("recording", "walk"),)


class Pictures:
    """One page of an app, and where its pictures go."""

    def __init__(self, browser: Browser, app: App, out: Path):
        viewer = ViewerPage(browser.new_page(viewport=SIZE))  # type: ignore[arg-type]
        viewer.open(app.address).wait_until_drawn(50)
        self.page, self.app, self._out = AppPage(viewer, app), app, out

    def take(self, name: str, *tabs: str) -> None:
        """A picture, after opening tabs."""
        for tab in tabs:
            self.page.tab(tab)
        self.page.page.wait_for_timeout(REST_MS)
        self.page.page.screenshot(path=str(self._out / f"{name}.png"))


def main(out: Path) -> None:
    """Take all pictures."""
    out.mkdir(parents=True, exist_ok=True)
    with sync_playwright() as playwright, tempfile.TemporaryDirectory() as work:
        os.environ["XDG_CONFIG_HOME"] = work
        browser = launch(playwright, chromium_path() or "chromium")
        for name, (make, shoot) in STATES.items():
            app = App(make(Path(work) / name), port=0)
            app.start()
            try:
                shoot(Pictures(browser, app, out), browser)
            finally:
                app.stop()
        browser.close()


def _without_recording(folder: Path) -> Project:
    project = make_app_project(folder)
    project.save(replace(project.settings, recordings={}))
    return project


def _bare(folder: Path) -> Project:
    project = make_app_project(folder, tags=False)
    walk = replace(project.recording("walk"), truth=None)
    project.save(replace(project.settings, recordings={"walk": walk}))
    return project


def _shoot_room(pictures: Pictures, _: Browser) -> None:
    pictures.take("no-recording")
    pictures.take("no-recording-layers", "Layers")


def _shoot_bare(pictures: Pictures, _: Browser) -> None:
    for tab in ("Project", "Keypoints", "Align", "Methods", "Layers", "Export"):
        pictures.take(f"bare-{tab.lower()}", "Frame", tab)


def _shoot_jobs(pictures: Pictures, browser: Browser) -> None:
    app = pictures.app
    app.jobs.start = lambda *_, **__: None  # type: ignore[method-assign]
    for job in (
        StartJob("Run everything", tasks.run_all, WALK),
        StartJob("Score the frames", tasks.score_frames, WALK),
    ):
        app.store.dispatch(job)
    app.store.dispatch(JobProgressed(0.3, "Reconstruct the keyframes: 3 of 8 frames", "about 3 minutes left", "begun"))
    pictures.take("job", "Frame", "Project")
    pictures.take("job-align", "Problems", "Align")
    app.store.dispatch(JobEnded(Level.ERROR, "Reconstruct the keyframes: too few frames found a place; record slower."))
    pictures.take("failed", "Project")
    app.store.dispatch(PickPoint(Side.SCAN, (1.0, 0.02, 1.5)))
    other = Pictures(browser, app, pictures._out)
    other.take("second-person", "Frame")
    pictures.take("keypoint", "Keypoints")
    app.server.stop()
    pictures.page.page.wait_for_timeout(8000)
    pictures.take("ended")


STATES: dict[str, tuple[Callable[[Path], Project], Callable[[Pictures, Browser], None]]] = {
    "room": (_without_recording, _shoot_room),
    "bare": (_bare, _shoot_bare),
    "jobs": (make_app_project, _shoot_jobs),
}

if __name__ == "__main__":
    main(Path(sys.argv[1]))
