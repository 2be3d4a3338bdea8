"""What our scripts do to the page's own drawing: the scan cut open, and detail spared while a slow view moves."""

from __future__ import annotations

import numpy as np
import pytest
from e2e.test_scene_page import WALLS, address, room, server  # noqa: F401
from gazeloc_app.scene.frusta import EDGES, CameraSet, FrustaLayer
from scipy.spatial.transform import RigidTransform, Rotation

from gazeloc_core.camera import Camera

pytestmark = pytest.mark.e2e

CAMERA = Camera.pinhole(320, 240, 260.0, 260.0, 160.0, 120.0)
LINES = "window.__viserTestpoints.rendererInfo.render.lines"
_SLOW_DOWN = """
() => {
  const scene = window.__viserMutable.scene, before = scene.onBeforeRender;
  scene.onBeforeRender = function (...all) {
    before.apply(this, all);
    const start = performance.now();
    while (performance.now() - start < 120);
  };
}
"""
_TURN = """
() => new Promise(done => {
  const m = window.__viserMutable, lines = [];
  const turn = () => {
    lines.push(window.__viserTestpoints.rendererInfo.render.lines);
    if (lines.length > 8) { done(Math.min(...lines)); return; }
    m.cameraControl.rotate(0.05, 0, false);
    m.requestRender();
    setTimeout(turn, 150);
  };
  turn();
})
"""


def test_what_is_above_the_cut_is_not_drawn_until_it_is_whole_again(server, open_page):  # noqa: F811
    above, below = (0.0, 1.0, 2.2), (0.0, 1.0, 1.0)
    page = open_page(address(server)).wait_until_drawn(300)
    assert page.color_at(above).tolist() == list(WALLS["left"])
    plane = server.scene.add_frame("/cut/0", show_axes=False, position=(0.0, 0.0, 1.6))
    page.wait_for_node("/cut/0")
    page.wait_until(lambda: page.color_at(above).tolist() != list(WALLS["left"]))
    assert page.color_at(below).tolist() == list(WALLS["left"])
    page.save("cut")
    plane.position = (0.0, 0.0, 0.6)
    page.wait_until(lambda: page.color_at(below).tolist() != list(WALLS["left"]))
    plane.remove()
    page.wait_until(lambda: page.color_at(above).tolist() == list(WALLS["left"]))


def test_a_slow_view_spares_lines_while_it_moves_and_has_all_when_it_rests(server, open_page):  # noqa: F811
    centers = np.random.default_rng(0).random((400, 3)) * (3, 2, 2) + 0.4
    poses = RigidTransform.from_components(centers, Rotation.identity())
    FrustaLayer(server.scene, "estimate").show(CameraSet(poses, CAMERA, (255, 0, 0)))
    page = open_page(address(server)).wait_until_drawn(300).wait_for_node("/frusta/estimate")
    whole = 400 * len(EDGES)
    page.wait_until(lambda: page.settle().page.evaluate(LINES) == whole)
    page.page.evaluate(_SLOW_DOWN)
    assert page.page.evaluate(_TURN) <= 0.3 * whole
    page.wait_until(lambda: page.settle().page.evaluate(LINES) == whole)
