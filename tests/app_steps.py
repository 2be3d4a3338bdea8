"""The app without its loop: apply what was dispatched, wait for a job, end everything."""

from __future__ import annotations

import time


def stop(app):
    app.scene.stop()
    app.jobs.stop()
    app._render.close()
    app.server.stop()
    app._lock.release()


def step(app, *actions):
    for action in actions:
        app.store.dispatch(action)
    app.store.step()


def wait_for_job(app, seconds=90.0):
    """Step until the job has ended."""
    end = time.monotonic() + seconds
    app.store.step()
    while app.store.state.job is not None:
        assert time.monotonic() < end, "the job did not end"
        time.sleep(0.05)
        app.store.step()
