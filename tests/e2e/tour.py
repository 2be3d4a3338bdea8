"""`make pictures`: the README's pictures of the app, taken anew from the sample scene in a headless browser.

python tests/e2e/tour.py PROJECT      a project of the sample scene whose stages have run (it is left as it was)
"""

from __future__ import annotations

import shutil
import sys
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np

TESTS = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TESTS), str(TESTS.parent), str(TESTS.parent / "app")]

from e2e.app_page import AppPage  # noqa: E402
from e2e.page import ViewerPage, chromium_path, launch  # noqa: E402
from gazeloc_app.actions.choices import CompareMethod  # noqa: E402
from gazeloc_app.actions.jobs import StartJob  # noqa: E402
from gazeloc_app.actions.pairs import RenamePair, SelectPair  # noqa: E402
from gazeloc_app.actions.picks import PickPoint, Side  # noqa: E402
from gazeloc_app.actions.views import DrawTags, ShowFrame  # noqa: E402
from gazeloc_app.app import App  # noqa: E402
from gazeloc_app.work import tasks  # noqa: E402
from playwright.sync_api import sync_playwright  # noqa: E402

from gazeloc_core.methods import Method  # noqa: E402
from gazeloc_core.project import Project  # noqa: E402
from gazeloc_core.stages import inputs  # noqa: E402

OUT = TESTS.parent / "static" / "tour"
WIDTH, HEIGHT = 1600, 900
TAG_NAMES = {0: "Tag beside the map", 3: "Tag by the lamp", 4: "Coffee table", 6: "Desk"}


def main(folder: Path) -> None:
    """Take all pictures."""
    with tempfile.TemporaryDirectory() as work:
        copy = Path(work) / "studio"
        shutil.copytree(folder, copy)
        app = App(_moved(folder, copy), port=0)
        app.start()
        try:
            with sync_playwright() as playwright:
                browser = launch(playwright, chromium_path() or "chromium")
                viewer = ViewerPage(browser.new_page(viewport={"width": WIDTH, "height": HEIGHT}))
                viewer.open(app.address).wait_until_drawn(10_000)
                _walk(AppPage(viewer, app), app)
                browser.close()
        finally:
            app.stop()


def _moved(folder: Path, copy: Path) -> Project:
    """The copy of a project, its paths pointing to where the original's did."""
    project = Project(copy)
    project.save(Project.open(folder).settings)
    return project


def _walk(page: AppPage, app: App) -> None:
    registered = np.flatnonzero(app.data.trajectory("glasses", app.store.state.annotation.alignment).is_registered)
    _show(page, app, int(registered[len(registered) // 3]))
    _place(app, (0.27, 0.42, 0.32), 0.85)
    _shoot(page, "app")
    _place(app, (0.25, 0.35, 0.3), 0.9)
    page.tab("Keypoints")
    _click_tags(app)
    page.until(lambda: len(page.pairs) == len(TAG_NAMES))
    _shoot(page, "keypoints")
    page.tab("Align")
    _place(app, (-0.35, 0.5, 0.2), 1.0)
    _shoot(page, "align")
    page.tab("Methods")
    app.store.dispatch(CompareMethod(Method.TAGS, True))
    app.store.dispatch(CompareMethod(Method.TAGS_PAPER, True))
    app.store.dispatch(DrawTags(True))
    _show(page, app, _frame_with_most_tags(app))
    _place(app, (0.27, 0.42, 0.32), 0.85)
    _shoot(page, "methods")
    app.store.dispatch(StartJob("Draw the figures", tasks.draw_figures, (("recording", "glasses"),)))
    page.tab("Figures").until(lambda: page.state.job is None)
    page.choose("Figure", "Figure 5, glasses")
    _shoot(page, "figures")
    for action in (CompareMethod(Method.TAGS, False), CompareMethod(Method.TAGS_PAPER, False), DrawTags(False)):
        app.store.dispatch(action)
    _show(page, app, int(registered[len(registered) // 2]))
    page.tab("Layers")
    for client in app.server.get_clients().values():
        app.browsers[client.client_id].look(app.store.state.frame)
    _shoot(page, "frame")


def _frame_with_most_tags(app: App) -> int:
    sightings = inputs.load_sightings(app.project.artifact("glasses", "tags").read_arrays())
    return int(np.bincount(sightings.frame_index).argmax())


def _show(page: AppPage, app: App, frame: int) -> None:
    app.store.dispatch(ShowFrame(frame))
    page.until(lambda: page.state.frame == frame)


def _click_tags(app: App) -> None:
    """Keypoints at tags, on both sides, as a person would click them: off by some millimetres."""
    rng = np.random.default_rng(0)
    on_scan, in_sfm = app.data.scan_tags(), app.data.sfm_tags("glasses")
    for tag, name in TAG_NAMES.items():
        for side, tags in ((Side.SCAN, on_scan), (Side.SFM, in_sfm)):
            row = np.flatnonzero(tags.tag_id == tag)
            if len(row):
                x, y, z = (tags.centers[row[0]] + rng.normal(0, 0.004, 3)).tolist()
                app.store.dispatch(PickPoint(side, (x, y, z)))
        app.store.dispatch(RenamePair(f"k{list(TAG_NAMES).index(tag) + 1}", name))
        app.store.dispatch(SelectPair(None))


def _place(app: App, eye: tuple[float, float, float], fov: float) -> None:
    """Look at the room's middle from a place given in shares of the room's half sizes."""
    low, high = np.percentile(app.data.mesh().vertices, [1, 99], axis=0)
    middle, half = (low + high) / 2, (high - low) / 2
    for client in app.server.get_clients().values():
        with client.atomic():
            client.camera.position = middle + half * np.array(eye) * 3.2
            client.camera.look_at = middle
            client.camera.fov = fov


def _shoot(page: AppPage, name: str) -> None:
    page.viewer.settle()
    time.sleep(4)  # pictures in the panel and the thumbnail arrive by themselves
    page.viewer.settle()
    picture = cv2.imdecode(np.frombuffer(page.page.screenshot(), np.uint8), cv2.IMREAD_COLOR)
    OUT.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(OUT / f"{name}.jpg"), picture, [cv2.IMWRITE_JPEG_QUALITY, 82])


if __name__ == "__main__":
    main(Path(sys.argv[1]))
