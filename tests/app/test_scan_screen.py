"""A scan too large to be packed at once: its points first, then its display from the other process, then from disk."""

import time

import numpy as np
import pytest
from app_project import make_app_project
from app_steps import stop
from gazeloc_app.app import App
from gazeloc_app.drawing import scan_screen
from gazeloc_app.scene import cloud


@pytest.fixture
def project(tmp_path, monkeypatch):
    monkeypatch.setattr(scan_screen, "SMALL", 10)
    return make_app_project(tmp_path)


def opened(project):
    app = App(project, port=0)
    app.store._render()
    return app, app.server.scene._handle_from_node_name


def test_points_show_until_the_scan_is_there_and_the_next_start_has_it_at_once(project):
    app, nodes = opened(project)
    try:
        assert "/scan-glimpse" in nodes
        assert "/scan" not in nodes
        assert "being made" in app.scene.facts(app.store.state)[0]
        end = time.monotonic() + 60
        while "/scan" not in nodes:
            assert time.monotonic() < end, "the display does not come"
            time.sleep(0.05)
            app.store.step()
        assert "/scan-glimpse" not in nodes
        assert app.store.state.notice.text == "The scan is ready."
        front = app.scene.front
    finally:
        stop(app)
    app, nodes = opened(project)
    try:
        assert "/scan" in nodes
        assert app.scene.front == front
    finally:
        stop(app)


def test_a_cloud_is_thinned_for_the_eye_and_says_so(project, monkeypatch):
    monkeypatch.setattr(cloud, "MAX_POINTS", 100)
    app, nodes = opened(project)
    try:
        total = len(app.data.model("walk").points)
        assert len(nodes["/sfm/cloud"].points) == 100 < total
        assert f"100 of {total:,} points are drawn" in app.scene.facts(app.store.state)[-1]
        kept = {tuple(point) for point in np.float32(app.data.model("walk").points).tolist()}
        assert {tuple(point) for point in nodes["/sfm/cloud"].points.tolist()} <= kept
    finally:
        stop(app)
