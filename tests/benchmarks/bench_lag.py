"""Lag of the server's event loop while reconstruction, ICP, scoring and BVH building run on the sample scene.

A coroutine on viser's own loop sleeps 5 ms again and again and takes down how much later than that it woke. The jobs
are the app's own, in its own processes; each is watched for some seconds and then cancelled. The loop shares two cores
with them, so this is the machine's lag too; the row without any job shows how much of it.
"""

from __future__ import annotations

import asyncio
import shutil
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from data import SAMPLE_SCENES
from gazeloc_app.actions.jobs import CancelJob, StartJob
from gazeloc_app.app import App
from gazeloc_app.demo import demo_project
from gazeloc_app.work import tasks

from gazeloc_core import pipeline
from gazeloc_core.methods import Method
from gazeloc_core.project import Project

Row = tuple[str, str, bool]
SLEEP_S = 0.005
WATCH_S = 12.0
P99_MS, MAX_MS = 50.0, 250.0


def bench_lag(work: Path, project: Project | None = None) -> list[Row]:
    """A row for each kind of work; a project of the sample scene that has run saves the minutes of making one."""
    if not (SAMPLE_SCENES / "studio").is_dir():
        return [("lag of the event loop: not measured, the sample scene is not here", "", False)]
    if project is None:
        work.mkdir(exist_ok=True)
        project = demo_project(work)
        pipeline.run(project)
    app = App(project, port=0)
    app.start()
    try:
        return _rows(app, project)
    finally:
        app.stop()


def _rows(app: App, project: Project) -> list[Row]:
    name = app.store.state.recording
    _wait(lambda: app.store.state.job is None)
    chosen = project.settings.chosen[name].alignment
    rows = [_row("building the BVH, opening the scene", _lags(app, WATCH_S))]
    of_recording = (("recording", name),)
    refine = StartJob("Refine", tasks.refine, (*of_recording, ("start", chosen)))
    score = StartJob("Score", tasks.score_frames, of_recording)
    work = (
        ("ICP", refine, project.artifact(name, "refinement")),
        ("scoring", score, project.result(name, Method.SFM, "scores")),
    )
    for what, job, artifact in work:
        shutil.rmtree(artifact.folder, ignore_errors=True)
        rows.append(_row(what, _lags_during(app, job)))
    shutil.rmtree(project.artifact(name, "reconstruction").folder, ignore_errors=True)
    rows.append(_row("reconstruction", _lags_during(app, StartJob("R", tasks.reconstruct, of_recording))))
    rows.append(_row("nothing, for comparison", _lags(app, 4.0)))
    return rows


def _lags_during(app: App, job: StartJob) -> np.ndarray:
    """Lags in seconds from the start of a job to its end or `WATCH_S` after it began to report."""
    app.store.dispatch(job)
    _wait(lambda: app.store.state.job is not None)
    lags = _lags(app, WATCH_S, lambda: app.store.state.job is not None)
    if app.store.state.job is not None:
        app.store.dispatch(CancelJob(app.store.state.job.number))
    _wait(lambda: app.store.state.job is None)
    return lags


def _lags(app: App, seconds: float, goes_on: Callable[[], bool] = lambda: True) -> np.ndarray:
    async def watch() -> list[float]:
        found, end = [], time.monotonic() + seconds
        while time.monotonic() < end and goes_on():
            before = time.perf_counter()
            await asyncio.sleep(SLEEP_S)
            found.append(time.perf_counter() - before - SLEEP_S)
        return found

    future = asyncio.run_coroutine_threadsafe(watch(), app.server.get_event_loop())
    return np.array(future.result(seconds + 60))


def _row(what: str, lags_s: np.ndarray) -> Row:
    p99, most = 1000 * float(np.percentile(lags_s, 99)), 1000 * float(lags_s.max())
    measured = f"p99 {p99:.0f} ms, max {most:.0f} ms ({len(lags_s)} looks)"
    is_met = bool(p99 <= P99_MS and most <= MAX_MS)
    return f"lag of the event loop during {what}: p99 <= {P99_MS:.0f} ms, max <= {MAX_MS:.0f} ms", measured, is_met


def _wait(is_so: Callable[[], bool], seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not is_so():
        if time.monotonic() > end:
            raise TimeoutError("the app did not get there")
        time.sleep(0.02)
