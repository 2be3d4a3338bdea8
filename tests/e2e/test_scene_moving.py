"""What our scripts do to the page's own drawing: the scan cut open, and detail spared while a slow view moves."""

from __future__ import annotations

import numpy as np
import pytest
from e2e.test_scene_page import WALLS, address, room, server  # noqa: F401
from gazeloc_app.palette import SCAN_SIDE
from gazeloc_app.scene.cloud import CloudLayer
from gazeloc_app.scene.frusta import EDGES, CameraSet, FrustaLayer
from gazeloc_app.scene.keypoints import KeypointsLayer
from scipy.spatial.transform import RigidTransform, Rotation

from gazeloc_core.camera import Camera
from gazeloc_core.keypoints import KeypointPair, KeypointSet

pytestmark = pytest.mark.e2e

CAMERA = Camera.pinhole(320, 240, 260.0, 260.0, 160.0, 120.0)
CYAN = (0, 255, 255)
"""Neither a wall nor a keypoint has it."""
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
_ORDER = """
(() => {
  window.seen = [];
  const note = what => { if (!window.seen.includes(what)) window.seen.push(what); };
  const look = () => {
    const t = window.__viserTestpoints;
    if (t && t.rendererInfo && t.rendererInfo.render.triangles > 300) note("room");
    if (document.body && document.body.innerText.includes("Press me")) note("button");
    setTimeout(look, 1);
  };
  look();
})()
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


def test_points_cameras_keypoints_and_labels_are_cut_too_and_cannot_be_dragged_unseen(server, open_page):  # noqa: F811
    above, below = np.array([1.0, 2.0, 2.2]), np.array([1.0, 2.0, 1.0])
    beside, dragged = np.array([0.0, -0.5, 0.0]), []
    cloud = CloudLayer(server.scene, point_size_m=0.08)
    cloud.show(np.array([above, below]), np.array([[1, 250, 2], [2, 1, 250]], np.uint8))
    poses = RigidTransform.from_components(np.array([above, below]) - beside, Rotation.identity())
    FrustaLayer(server.scene, "estimate", depth_m=0.3).show(CameraSet(poses, CAMERA, CYAN))
    places = [tuple((place + beside).tolist()) for place in (above, below)]
    pairs = tuple(KeypointPair(f"k{n}", f"Corner {n}", place, None) for n, place in enumerate(places))
    keypoints = KeypointsLayer(server.scene, on_drag=lambda side, key, event: dragged.append((key, event.phase)))
    keypoints.show(KeypointSet(pairs), None)
    page = open_page(address(server)).wait_until_drawn(500)
    for name in ("/sfm/cloud", "/frusta/estimate", "/keypoints/k1/scan"):
        page.wait_for_node(name)
    page.wait_until(lambda: np.abs(page.color_at(above) - (1, 250, 2)).max() <= 2)
    assert all(page.has_color_near(place - beside, CYAN) for place in (above, below))
    assert all(has_white(page, place) for place in places)

    plane = server.scene.add_frame("/cut/0", show_axes=False, position=(0.0, 0.0, 1.6))
    page.wait_for_node("/cut/0")
    page.wait_until(lambda: not has_white(page, places[0]))
    page.save("cut-everything")
    assert np.abs(page.color_at(above) - (1, 250, 2)).max() > 50
    assert not page.has_color_near(above - beside, CYAN)
    assert not page.has_color_near(places[0], SCAN_SIDE)
    assert np.abs(page.color_at(below) - (2, 1, 250)).max() <= 2
    assert page.has_color_near(below - beside, CYAN)
    assert has_white(page, places[1])
    drag(page, places[0])
    drag(page, places[1])
    page.wait_until(lambda: ("k1", "end") in dragged)
    assert not [key for key, _ in dragged if key == "k0"]

    plane.remove()
    page.wait_until(lambda: has_white(page, places[0]))
    assert np.abs(page.color_at(above) - (1, 250, 2)).max() <= 2
    drag(page, places[0])
    page.wait_until(lambda: ("k0", "end") in dragged)


def has_white(page, point):
    """Whether the ground of a label is at a place of the view; there is no other white in it."""
    return bool((page.pixels_around(point, 24).min(axis=2) > 200).any())


def drag(page, point):
    """Drag whatever is at a place of the view a little to the side."""
    page.wait_until_drawn(1)
    x, y = np.floor(page.project(point)[0])
    mouse = page.page.mouse
    mouse.move(x, y)
    mouse.down()
    mouse.move(x + 15, y, steps=5)
    mouse.up()
    page.wait_until_drawn(1)


def test_a_slow_view_spares_lines_while_it_moves_and_has_all_when_it_rests(server, open_page):  # noqa: F811
    centers = np.random.default_rng(0).random((400, 3)) * (3, 2, 2) + 0.4
    poses = RigidTransform.from_components(centers, Rotation.identity())
    FrustaLayer(server.scene, "estimate").show(CameraSet(poses, CAMERA, (255, 0, 0)))
    page = open_page(address(server)).wait_until_drawn(300).wait_for_node("/frusta/estimate")
    whole = 400 * len(EDGES)
    page.wait_until(lambda: page.settle().page.evaluate(LINES) == whole)
    page.page.evaluate(_SLOW_DOWN)
    assert page.page.evaluate(_TURN) <= 0.15 * whole
    page.wait_until(lambda: page.settle().page.evaluate(LINES) == whole)


def test_the_room_is_drawn_before_the_panels_are_filled(server, open_page):  # noqa: F811
    with server.gui.add_folder("A panel"):
        server.gui.add_button("Press me")
    page = open_page(address(server), script=_ORDER).wait_until_drawn(300)
    page.page.get_by_role("button", name="Press me").wait_for()
    seen = page.page.evaluate("window.seen")
    assert seen.index("room") < seen.index("button")
    assert page.page.evaluate("window.gazelocScene.isComplete()")


def test_after_a_lost_connection_the_panels_are_there_again(server, open_page):  # noqa: F811
    server.gui.add_button("Press me")
    page = open_page(address(server)).wait_until_drawn(300)
    button = page.page.get_by_role("button", name="Press me")
    button.wait_for()
    page.page.bring_to_front()
    before = set(server.get_clients())
    server._websock_server.disconnect_all_clients()
    page.wait_until(lambda: set(server.get_clients()) - before)
    button.wait_for()
    assert button.count() == 1


_STAND_ELSEWHERE = """
document.addEventListener("DOMContentLoaded", () => {
  for (const kind of ["pointerdown", "keydown"]) {
    const field = document.body.appendChild(document.createElement("input"));
    field.dispatchEvent(new Event(kind, { bubbles: true })); // as when a notice is closed, or a name is typed
    field.remove();
  }
});
const elsewhere = setInterval(() => {
  const viewer = window.__viserMutable;
  if (!viewer || !viewer.cameraControl || !window.gazelocScene) return;
  if (window.gazelocScene.isReleased()) clearInterval(elsewhere);
  else viewer.cameraControl.setPosition(3, 3, 3);
}, 5);
"""


def test_a_page_stands_at_the_start_wherever_the_viewer_stood_while_it_loaded(server, open_page):  # noqa: F811
    middle, back = np.array([1.5, 1.0, 1.0]), np.array([0.0, -4.0, 3.0])
    server.initial_camera.position = middle + back
    server.initial_camera.look_at = middle
    page = open_page(address(server), script=_STAND_ELSEWHERE)
    page.wait_until(lambda: page.page.evaluate("() => !!window.gazelocScene && window.gazelocScene.isReleased()"))
    page.wait_until_drawn(300)
    ends = page.project([middle + back / 2, middle - back / 2])  # on the axis of the view
    assert np.abs(ends[0] - ends[1]).max() < 2
