"""`make bench`: every number that the issue of this product and its README name, measured now, with its target.

    python tests/benchmarks [NAME] ...     of those in BENCHES below

Exit code 1 where a target is missed. Times are of this machine at this moment; ratios hold on noisy ones.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TESTS), str(TESTS.parent), str(TESTS.parent / "app"), str(TESTS / "e2e")]

from data import SAMPLE_SCENES, SHARED  # noqa: E402

Row = tuple[str, str, bool]
STUDIO = SAMPLE_SCENES / "studio"


def alignment(work: Path) -> list[Row]:
    """Keypoints and ICP in a made-up room with known errors (on the sample scene: see `scene`)."""
    from bench_alignment import bench_icp, bench_keypoints, box_room

    bench = box_room()
    return [*bench_keypoints(bench), *bench_icp(bench)]


def whole_scene(work: Path) -> list[Row]:
    """The sample scene from its files."""
    from bench_scene import bench_scene

    return bench_scene(STUDIO, work)


def real_chair(work: Path) -> list[Row]:
    """The real chair scan, where it is there."""
    from bench_chair import bench_chair

    source = SHARED / "3dscannerapp_chair" / "chair_scan"
    if not source.is_dir():
        return [("chair: not measured, the real recordings are not here", str(SHARED), True)]
    return bench_chair(source, work)


def real_bedroom(work: Path) -> list[Row]:
    """The real bedroom with tags, where it is there."""
    from bench_bedroom import bench_bedroom

    room = SHARED / "swatbotics_room_B"
    if not room.is_dir():
        return [("bedroom: not measured, the real recordings are not here", str(SHARED), True)]
    return bench_bedroom(room)


def browser_app(work: Path) -> list[Row]:
    """The app in a headless browser."""
    from bench_app import bench_app

    return bench_app(work)


def agreement(work: Path) -> list[Row]:
    """Whether the agreement score ranks wrong poses below true ones."""
    from bench_agreement import bench_agreement

    return bench_agreement(STUDIO)


def scene_at_size(work: Path) -> list[Row]:
    """A large scan, a large reconstruction and a long recording in a headless browser."""
    from bench_size import bench_size

    return bench_size(work)


def suggestions(work: Path) -> list[Row]:
    """Suggested places for keypoints, by a scripted user."""
    from bench_suggestions import bench_suggestions

    return bench_suggestions()


def door(work: Path) -> list[Row]:
    """Hostile visitors, each refused, and what a flood costs the others."""
    from bench_door import bench_door

    return bench_door(work)


def scrubbing(work: Path) -> list[Row]:
    """Going through frames in a headless browser."""
    from bench_app import _app, _project
    from bench_scrub import bench_scrub
    from e2e.page import chromium_path, launch
    from playwright.sync_api import sync_playwright

    path = chromium_path()
    if path is None:
        return [("scrubbing: not measured, no chromium is installed", "", False)]
    project = _project(work)
    with sync_playwright() as playwright, _app(project) as app:
        browser = launch(playwright, path)
        rows = bench_scrub(browser, app)
        browser.close()
    return rows


def picking(work: Path) -> list[Row]:
    """Clicks on half a million triangles."""
    from bench_picking import bench_picking

    return bench_picking(work)


def crashes(work: Path) -> list[Row]:
    """Two browsers at work, and kill -9."""
    from bench_crash import bench_crash

    return bench_crash(work)


def lag(work: Path) -> list[Row]:
    """The server's event loop while jobs run."""
    from bench_lag import bench_lag

    return bench_lag(work)


BENCHES: dict[str, Callable[[Path], list[Row]]] = {
    "alignment": alignment,
    "suggestions": suggestions,
    "picking": picking,
    "scene": whole_scene,
    "chair": real_chair,
    "bedroom": real_bedroom,
    "app": browser_app,
    "agreement": agreement,
    "scrub": scrubbing,
    "size": scene_at_size,
    "door": door,
    "crash": crashes,
    "lag": lag,
}


def main() -> int:
    """Run the named benchmarks, or all."""
    missed = 0
    for name in sys.argv[1:] or list(BENCHES):
        started = time.monotonic()
        with tempfile.TemporaryDirectory() as work:
            rows = BENCHES[name](Path(work))
        print(f"\n{name} ({time.monotonic() - started:.0f} s)")
        for what, measured, is_met in rows:
            print(f"  {'ok    ' if is_met else 'MISSED'}  {what:<85} {measured}", flush=True)
            missed += not is_met
    print(f"\n{missed} targets missed." if missed else "\nAll targets met.")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
