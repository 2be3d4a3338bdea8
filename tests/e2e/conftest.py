"""One headless browser for these tests, and pages in it."""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from app_project import make_app_project
from e2e.page import ViewerPage, chromium_path, launch
from gazeloc_app.app import App
from playwright.sync_api import Browser, Error, sync_playwright

from gazeloc_core.project import Project

SIZE = {"width": 900, "height": 620}
HARMLESS = (
    "Unable to preventDefault inside passive event listener",  # viser's own, when a node is dragged
    "net::ERR_CONNECTION_REFUSED",  # the app ends before its pages do, and they ask whether it is still there
)


@pytest.fixture(scope="module")  # not longer: while Playwright runs, no other test can use asyncio
def browser() -> Iterator[Browser]:
    """Chromium; without one the tests are skipped with one loud line, on CI they fail."""
    path = chromium_path()
    if path is None:
        _no_browser("no chromium is installed")
    with sync_playwright() as playwright:
        try:
            browser = launch(playwright, str(path))
        except Error as error:
            _no_browser(f"{path} does not start ({str(error).splitlines()[0]})")
        yield browser
        browser.close()


@pytest.fixture
def open_page(browser: Browser, request: pytest.FixtureRequest) -> Iterator[Callable[..., ViewerPage]]:
    """Opens pages, each in a profile of its own; keeps screenshots of a failed test, and fails on page errors."""
    opened: list[ViewerPage] = []

    def open_page(address: str, *, script: str = "", **size: int) -> ViewerPage:
        """`script` runs in the page before its own."""
        context = browser.new_context(viewport=SIZE | size, device_scale_factor=1)
        opened.append(ViewerPage(context.new_page()))
        opened[-1].page.add_init_script(script)
        return opened[-1].open(address)

    yield open_page
    report = getattr(request.node, "call_report", None)
    for number, viewer in enumerate(opened):
        if report is not None and report.failed:
            viewer.save(re.sub(r"\W+", "-", f"{request.node.name}-{number}"))
        viewer.page.context.close()
    complaints = [error for viewer in opened for error in viewer.errors if not any(h in error for h in HARMLESS)]
    assert not complaints, f"the page complained: {complaints}"


@pytest.fixture
def project(tmp_path: Path) -> Project:
    """A small project as the stages would have left it."""
    return make_app_project(tmp_path)


@pytest.fixture
def app(project: Project) -> Iterator[App]:
    """The app on it, running."""
    app = App(project, port=0)
    app.start()
    yield app
    app.stop()


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Iterator[None]:
    """Leave the test's outcome where fixtures find it."""
    outcome = yield
    report = outcome.get_result()
    if report.when == "call":
        item.call_report = report


def _no_browser(why: str) -> None:
    sentence = f"BROWSER TESTS NOT RUN: {why}; install chromium and run `make test` again."
    if os.environ.get("CI", "").lower() == "true":
        pytest.fail(sentence)
    warnings.warn(sentence, stacklevel=1)
    pytest.skip(sentence)
