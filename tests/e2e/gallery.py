"""Pictures of every panel in every look, to be looked at: python tests/e2e/gallery.py PROJECT OUT

A picture per tab of a finished project at 1280x800 and 1440x900 in the light, in the dark, on a tablet, flat and
upright, and with the colours for colour-blind eyes; then of the same project before anything was run, where panels say
what to do first. The project is copied and left as it was.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TESTS), str(TESTS.parent), str(TESTS.parent / "app")]

from e2e.app_page import AppPage  # noqa: E402
from e2e.page import ViewerPage, chromium_path, launch  # noqa: E402
from gazeloc_app.actions.views import UseSafeColors  # noqa: E402
from gazeloc_app.app import App  # noqa: E402
from playwright.sync_api import Browser, sync_playwright  # noqa: E402

from gazeloc_core.project import Project  # noqa: E402

LOOKS = {
    "light": (1280, 800),
    "wide": (1440, 900),
    "dark": (1280, 800),
    "flat": (1180, 820),
    "upright": (820, 1180),
    "safe": (1280, 800),
}


def main(folder: Path, out: Path, only: tuple[str, ...]) -> None:
    """Take all pictures, or only of the named looks (of LOOKS, and "empty")."""
    out.mkdir(parents=True, exist_ok=True)
    with sync_playwright() as playwright, tempfile.TemporaryDirectory() as work:
        os.environ["XDG_CONFIG_HOME"] = work  # the colours that are tried are nobody's own settings
        browser = launch(playwright, chromium_path() or "chromium")
        copy = Path(shutil.copytree(folder, Path(work) / "studio"))
        with _app(folder, copy) as app:
            for name, size in LOOKS.items():
                if not only or name in only:
                    _shoot_tabs(browser, app, size, out, name)
        if not only or "empty" in only:
            with _app(folder, Path(work) / "empty") as app:
                _shoot_tabs(browser, app, (1280, 800), out, "empty")
        browser.close()


@contextmanager
def _app(folder: Path, copy: Path) -> Iterator[App]:
    """The app on a copy whose settings point to the files of the original."""
    project = Project(copy)
    if copy.is_dir():
        project.save(Project.open(folder).settings)
    else:
        project = Project.create(copy, replace(Project.open(folder).settings, chosen={}))
    app = App(project, port=0)
    app.start()
    try:
        yield app
    finally:
        app.stop()


def _shoot_tabs(browser: Browser, app: App, size: tuple[int, int], out: Path, look: str) -> None:
    app.store.dispatch(UseSafeColors(look == "safe"))
    page = browser.new_page(viewport={"width": size[0], "height": size[1]})
    viewer = ViewerPage(page)
    viewer.open(app.address).wait_until_drawn(100)
    view = AppPage(viewer, app)
    if look == "dark":
        view.tab("Help").press("Light or dark")
    page.wait_for_timeout(3000)
    for tab in page.get_by_role("tab").locator("visible=true").all_inner_texts():
        view.tab(tab)
        page.wait_for_timeout(800)
        page.screenshot(path=str(out / f"{look}-{tab.strip().lower()}.png"))
    page.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), tuple(sys.argv[3:]))
