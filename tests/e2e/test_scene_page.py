"""The 3D view in a real browser: true colours, true rays, and every layer where it belongs."""

from __future__ import annotations

import threading

import numpy as np
import pytest
from gazeloc_app import palette
from gazeloc_app.keypoints import picking
from gazeloc_app.routes import Routes, add_static_route
from gazeloc_app.scene import frusta, tags
from gazeloc_app.scene.cloud import CloudLayer
from gazeloc_app.scene.frames import PLANE_M, FrameInSceneLayer, SelectedFrameLayer, look_through
from gazeloc_app.scene.gaze import GazeLayer
from gazeloc_app.scene.keypoints import KeypointsLayer
from gazeloc_app.scene.room import RoomLayer
from gazeloc_app.scene.view import set_start
from gazeloc_app.server import make_server
from scipy.spatial.transform import RigidTransform, Rotation

from gazeloc_core.camera import Camera
from gazeloc_core.keypoints import KeypointPair, KeypointSet
from gazeloc_core.scan import Mesh
from gazeloc_core.surfaces.glb import mesh_glb
from gazeloc_core.surfaces.raycast import Raycaster
from gazeloc_core.surfaces.viewpoint import facing
from gazeloc_core.tag_types import TagCorners
from gazeloc_core.transforms import Similarity

pytestmark = pytest.mark.e2e

CAMERA = Camera.pinhole(320, 240, 260.0, 260.0, 170.0, 112.0)
WALLS = {
    "floor": (64, 128, 192),
    "ceiling": (250, 250, 250),
    "left": (200, 40, 40),
    "right": (40, 160, 60),
    "front": (128, 128, 128),
    "back": (255, 200, 10),
}


def room() -> Mesh:
    """A room of 4 x 3 x 2.6 m, z up, each face of one colour, faces turned inwards, in a fine grid."""
    n, size = 8, np.array([4.0, 3.0, 2.6])
    u, v = (axis.ravel() for axis in np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1)))
    zero, one = np.zeros_like(u), np.ones_like(u)
    sides = {
        "floor": (u, v, zero),
        "ceiling": (v, u, one),
        "left": (zero, u, v),
        "right": (one, v, u),
        "front": (v, zero, u),
        "back": (u, one, v),
    }
    i = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    grid = np.concatenate([np.stack([i, i + 1, i + n + 2], 1), np.stack([i, i + n + 2, i + n + 1], 1)])
    vertices = np.concatenate([np.column_stack(side) * size for side in sides.values()])
    faces = np.concatenate([grid + k * len(u) for k in range(len(sides))])
    colors = np.repeat(np.array([WALLS[name] for name in sides], np.uint8), len(u), axis=0)
    return Mesh(vertices, faces.astype(np.int32), colors)


@pytest.fixture
def server():
    routes = Routes()
    add_static_route(routes)
    server = make_server(0, routes)
    mesh = room()
    turned, is_clear = facing(mesh, [[2, 1.5, 1.3]])
    assert is_clear
    layer = RoomLayer(server.scene)
    layer.show(mesh_glb(turned))
    layer.set_look(two_sided=False)
    set_start(server, mesh, "z")
    server.gui.main_panel.dock_right()
    server.gui.main_panel.set_width(240)
    yield server
    server.stop()


def pixels_of(page, color) -> int:
    """How many pixels of the view are of this colour, but for the blurring of edges."""
    return int((np.abs(page.canvas_pixels().astype(int) - color).max(axis=2) < 12).sum())


def address(server) -> str:
    return f"http://localhost:{server.get_port()}"


def test_the_room_is_drawn_in_exactly_its_colours(server, open_page):
    page = open_page(address(server)).wait_until_drawn(300)
    for name, point in {"floor": (1.0, 0.7, 0.0), "left": (0.0, 1.0, 1.2), "front": (1.5, 0.0, 1.4)}.items():
        assert page.color_at(point).tolist() == list(WALLS[name]), name


def test_near_walls_do_not_hide_the_room(server, open_page):
    page = open_page(address(server)).wait_until_drawn(300)
    shown = page.canvas_pixels().reshape(-1, 3)
    for name in ("ceiling", "right", "back"):
        assert not (shown == WALLS[name]).all(axis=1).any(), name


def test_a_click_gives_the_ray_through_the_pixel(server, open_page):
    rays = []
    clicked = threading.Event()

    @server.scene.on_click()
    async def _(event):
        rays.append((event.ray_origin, event.ray_direction))
        clicked.set()

    page = open_page(address(server)).wait_until_drawn(300).wait_for_clicks()
    raycaster = Raycaster(room())
    for target in ([1.2, 0.9, 0.0], [0.0, 1.1, 1.7], [2.2, 0.0, 0.6]):
        clicked.clear()
        pixel = page.click_at_point(target)
        assert clicked.wait(10)
        origin, direction = rays[-1]
        inside = np.asarray(origin) + 2.0 * np.asarray(direction)
        # Below a title bar the canvas is no whole number of pixels high, which viser rounds: a fifth of a pixel.
        np.testing.assert_allclose(page.project([inside])[0], pixel, atol=0.3)
        # The near walls face away: go to the target's depth before casting.
        start = np.asarray(origin) + (np.linalg.norm(np.subtract(target, origin)) - 0.8) * np.asarray(direction)
        point = picking.pick_mesh(raycaster, start, direction)
        assert np.linalg.norm(point - target) < 0.012


def test_dragging_the_view_makes_no_click(server, open_page):
    clicks = []

    @server.scene.on_click()
    async def _(event):
        clicks.append(event)

    page = open_page(address(server)).wait_until_drawn(300).wait_for_clicks()
    before = page.project([[1, 1, 0]])[0]
    mouse = page.page.mouse
    mouse.move(300, 300)
    mouse.down()
    mouse.move(340, 320, steps=6)
    mouse.up()
    page.settle()
    assert np.linalg.norm(page.project([[1, 1, 0]])[0] - before) > 5
    assert not clicks


def test_layers_appear_where_they_belong_and_hide(server, open_page):
    similarity = Similarity(2.0, Rotation.from_euler("z", 90, degrees=True), np.array([2.0, 1.0, 0.5]))
    back = similarity.inverse()
    cloud = CloudLayer(server.scene, point_size_m=0.08)
    point = np.array([1.0, 1.0, 0.6])
    cloud.show(back.apply(point[None]), np.array([[1, 2, 250]], np.uint8))
    cloud.align(similarity)
    keypoints = KeypointsLayer(server.scene)
    place = (0.5, 2.0, 0.9)
    keypoints.show(KeypointSet((KeypointPair("k1", "desk corner", place, None),)), None)
    estimate = frusta.FrustaLayer(server.scene, "estimate", depth_m=0.4)
    pose = RigidTransform.from_components([[2.5, 1.0, 1.2]], Rotation.from_euler("x", [-90], degrees=True))
    estimate.show(frusta.CameraSet(pose, CAMERA, palette.USUAL.estimate))
    corners = np.array([[[0.01, 1, 1], [0.01, 1.4, 1], [0.01, 1.4, 1.4], [0.01, 1, 1.4]]])
    outlines = tags.TagsLayer(server.scene, "scan", palette.SCAN_TAGS)
    outlines.show(TagCorners(np.array([7]), corners, np.array([3]), np.array([0.001])))
    gaze = GazeLayer(server.scene)
    gaze.show(np.array([3.0, 2.0, 1.4]), hit=np.array([0.0, 0.4, 0.5]))
    SelectedFrameLayer(server.scene).show(pose[0], CAMERA)

    page = open_page(address(server)).wait_until_drawn(500)
    for name in ("/sfm/cloud", "/keypoints/k1/scan", "/frusta/estimate", "/gaze/hit", "/selected"):
        page.wait_for_node(name)
    page.save("layers")
    assert np.abs(page.color_at(point) - (1, 2, 250)).max() <= 2
    assert page.has_color_near(place, palette.SCAN_SIDE)
    assert page.label_at(place)
    assert page.label_at(corners[0].mean(axis=0))
    assert pixels_of(page, palette.USUAL.estimate) > 50
    for layer in (cloud, keypoints, estimate, outlines, gaze):
        layer.set_visible(False)
    page.wait_until(lambda: pixels_of(page, palette.USUAL.estimate) == 0)
    page.wait_until(lambda: not page.label_at(place))
    assert page.color_at(point).tolist() in [list(color) for color in WALLS.values()]


def test_looking_through_a_frame_its_picture_lies_on_the_scene_and_a_click_is_its_pixel(server, open_page):
    clicks = []
    clicked = threading.Event()
    pose = RigidTransform.from_components([2.4, 1.6, 1.4], Rotation.from_euler("xyz", [-100, 5, 60], degrees=True))
    image = np.full((240, 320, 3), 90, np.uint8)
    image[30:40, 250:260] = (255, 0, 255)
    ready = threading.Event()

    @server.on_client_connect
    async def _(client):
        FrameInSceneLayer(client.scene).show(pose, CAMERA, image)
        view = look_through(pose, CAMERA)
        with client.atomic():
            client.camera.fov = view.fov_rad
            client.camera.wxyz = view.wxyz
            client.camera.position = view.position

        @client.scene.on_click()
        async def _(event):
            clicks.append((event.ray_origin, event.ray_direction))
            clicked.set()

        ready.set()

    page = open_page(address(server))
    assert ready.wait(30)
    page.wait_for_node("/picture").wait_until_drawn(2).wait_for_clicks()
    page.save("look-through")
    spot = np.array([255.0, 35.0])
    in_scan = pose.apply(PLANE_M * np.array([*(spot - CAMERA.principal_point_px) / CAMERA.focal_px, 1.0]))
    assert np.abs(page.color_at(in_scan) - (255, 0, 255)).max() <= 12
    page.click_at_point(in_scan)
    assert clicked.wait(10)
    pixel = picking.pixel_in_frame(CAMERA, pose, *clicks[0], PLANE_M)
    assert np.abs(pixel - spot).max() < 0.6


def test_the_page_still_has_the_hooks_that_we_use(server, open_page):
    page = open_page(address(server)).wait_until_drawn(300).page
    assert page.evaluate("typeof window.__viserMutable.scene.onBeforeRender") == "function"
    assert page.title() == "GazeLoc"
    for hook in ("__viserMutable.requestRender", "__viserPointer.hasSceneClickFilter"):
        assert page.evaluate(f"typeof window.{hook}") == "function"
