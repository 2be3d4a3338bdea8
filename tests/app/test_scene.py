"""The scene's layers on a server without a browser: what is sent, and what is not sent again."""

import numpy as np
import pytest
from gazeloc_app.palette import SCAN_TAGS, SELECTED
from gazeloc_app.routes import Routes
from gazeloc_app.scene.cloud import CloudLayer
from gazeloc_app.scene.frames import FrameInSceneLayer, SelectedFrameLayer, look_through, picture_plane
from gazeloc_app.scene.frusta import EDGES, FEW_EDGES, MANY, CameraSet, FrustaLayer, _lines, frustum_points
from gazeloc_app.scene.gaze import GazeLayer
from gazeloc_app.scene.grid import GridLayer, grid_lines
from gazeloc_app.scene.keypoints import KeypointsLayer
from gazeloc_app.scene.room import RoomLayer
from gazeloc_app.scene.sizes import size_factor
from gazeloc_app.scene.tags import TagsLayer
from gazeloc_app.scene.view import FOV_RAD, overview, set_start, up_vector
from gazeloc_app.server import make_server
from scipy.spatial.transform import RigidTransform, Rotation

from gazeloc_core.camera import Camera
from gazeloc_core.keypoints import KeypointPair, KeypointSet
from gazeloc_core.scan import Mesh, Texture
from gazeloc_core.surfaces.glb import mesh_glb
from gazeloc_core.surfaces.viewpoint import facing
from gazeloc_core.tag_types import TagCorners
from gazeloc_core.transforms import Similarity

CAMERA = Camera.pinhole(320, 240, 260.0, 250.0, 170.0, 112.0)
BOX = Mesh(
    np.array([[x, y, z] for x in (0, 4) for y in (0, 3) for z in (0, 2.5)], float),
    np.array(  # faces turned outwards
        [0, 1, 3, 0, 3, 2, 4, 6, 7, 4, 7, 5, 0, 4, 5, 0, 5, 1, 2, 3, 7, 2, 7, 6, 0, 2, 6, 0, 6, 4, 1, 5, 7, 1, 7, 3]
    ).reshape(-1, 3),
    np.full((8, 3), 100, np.uint8),
)
SIMILARITY = Similarity(2.0, Rotation.from_euler("z", 90, degrees=True), np.array([1.0, 2.0, 3.0]))


@pytest.fixture(scope="module")
def server():
    server = make_server(0, Routes())
    yield server
    server.stop()


@pytest.fixture
def sent(server, monkeypatch):
    """The messages that leave from now on, as (type, node)."""
    messages = []
    queue = server._websock_server.queue_message

    def record(message):
        messages.append((type(message).__name__, getattr(message, "name", "")))
        queue(message)

    for owner in (server._websock_server, server.scene._websock_interface):
        monkeypatch.setattr(owner, "queue_message", record)
    yield messages
    monkeypatch.undo()
    server.scene.reset()


def names(server):
    return set(server.scene._handle_from_node_name)


def test_the_room_is_sent_once_and_again_when_its_look_changes(server, sent):
    layer, glb = RoomLayer(server.scene), mesh_glb(BOX)
    layer.show(glb)
    assert ("GlbMessage", "/scan") in sent
    sent.clear()
    layer.show(glb)
    layer.set_look()
    assert sent == []
    layer.set_visible(False)
    assert [kind for kind, _ in sent] == ["SetSceneNodeVisibilityMessage"]
    layer.set_look(tint=(255, 0, 0))
    assert ("GlbMessage", "/scan") in sent
    layer.show(None)
    assert "/scan" not in names(server)


def test_faces_turn_towards_where_the_room_was_scanned_from():
    turned, is_clear = facing(BOX, [[2, 1.5, 1.2]])
    assert is_clear
    a, b, c = (turned.vertices[turned.faces[:, i]] for i in range(3))
    inwards = np.array([2, 1.5, 1.2]) - (a + b + c) / 3
    assert (np.einsum("ij,ij->i", np.cross(b - a, c - a), inwards) > 0).all()
    assert facing(turned, [[2, 1.5, 1.2]])[0] is turned


def test_faces_without_a_clear_side_are_left_to_be_seen_from_both():
    mixed = BOX.faces.copy()
    mixed[::2] = mixed[::2, ::-1]
    assert not facing(Mesh(BOX.vertices, mixed), [[2, 1.5, 1.2]])[1]


def test_turning_a_face_keeps_each_corner_at_its_place_in_the_picture():
    uv = np.random.default_rng(0).random((len(BOX.faces), 3, 2)).astype(np.float32)
    texture = Texture((np.zeros((4, 4, 3), np.uint8),), uv, np.zeros(len(BOX.faces), np.int32))
    turned, _ = facing(Mesh(BOX.vertices, BOX.faces, None, texture), [[2, 1.5, 1.2]])
    for face in range(len(BOX.faces)):
        before = dict(zip(BOX.faces[face].tolist(), uv[face].tolist(), strict=True))
        after = dict(zip(turned.faces[face].tolist(), turned.texture.uv_of_corner[face].tolist(), strict=True))
        assert before == after


def test_an_alignment_moves_the_cloud_with_a_few_small_messages(server, sent):
    layer = CloudLayer(server.scene)
    points, colors = np.random.default_rng(0).random((50, 3)), np.zeros((50, 3), np.uint8)
    layer.show(points, colors)
    sent.clear()
    layer.show(points, colors)
    assert sent == []
    layer.align(SIMILARITY)
    assert 0 < len(sent) <= 4
    assert not any(kind == "PointCloudMessage" for kind, _ in sent)
    node = server.scene._handle_from_node_name["/sfm/cloud"]
    assert (node.scale, node.position.tolist()) == (2.0, [1, 2, 3])
    np.testing.assert_allclose(node.wxyz, [np.sqrt(0.5), 0, 0, np.sqrt(0.5)])
    layer.show(None, None)
    assert "/sfm/cloud" not in names(server)


def test_a_cloud_shown_after_its_alignment_is_placed_too(server, sent):
    layer = CloudLayer(server.scene)
    layer.align(SIMILARITY)
    layer.show(np.zeros((1, 3)), None, tint=(9, 8, 7))
    assert server.scene._handle_from_node_name["/sfm/cloud"].scale == 2.0


def test_a_frustums_lines_end_where_the_camera_sees_its_pictures_corners():
    pose = RigidTransform.from_components(
        [[1.0, 2, 3], [0, 0, 0]], Rotation.from_euler("xyz", [[30, 40, 50], [0, 0, 0]], degrees=True)
    )
    points = frustum_points(pose, CAMERA, 0.4)
    assert points.shape == (2, 6, 3)
    np.testing.assert_allclose(points[0, 0], [1.0, 2, 3])
    in_camera = pose[0].inv().apply(points[0, 1:5])
    np.testing.assert_allclose(in_camera[:, 2], 0.4)
    np.testing.assert_allclose(CAMERA.project(in_camera), [[0, 0], [320, 0], [320, 240], [0, 240]], atol=1e-9)
    assert {tuple(edge) for edge in EDGES[:4].tolist()} == {(0, 1), (0, 2), (0, 3), (0, 4)}
    assert points[1, 5, 1] < points[1, 1:5, 1].min()  # y points down, so the roof marks the top


def test_any_number_of_cameras_is_one_node(server, sent):
    layer = FrustaLayer(server.scene, "estimate")
    poses = RigidTransform.from_components(np.random.default_rng(0).random((300, 3)), Rotation.identity())
    path = np.array(poses.translation)
    path[7] = np.nan
    cameras = CameraSet(poses[::3], CAMERA, (255, 0, 0), path)
    layer.show(cameras)
    assert [message for message in sent if message[0] == "GlbMessage"] == [("GlbMessage", "/frusta/estimate")]
    sent.clear()
    layer.show(cameras)
    assert sent == []
    layer.show(None)
    assert "/frusta/estimate" not in names(server)


def test_each_of_very_many_cameras_has_fewer_lines_and_shows_how_it_is_turned():
    poses = RigidTransform.from_components(np.zeros((MANY + 1, 3)), Rotation.identity())
    few = _lines(CameraSet(poses, CAMERA, (255, 0, 0)), 0.1)[1]
    every = _lines(CameraSet(poses[:MANY], CAMERA, (255, 0, 0)), 0.1)[1]
    assert len(few) == (MANY + 1) * len(FEW_EDGES) < len(every) == MANY * len(EDGES)
    assert [1, 2] in FEW_EDGES.tolist()  # between the picture's upper corners


def test_tags_are_moved_by_an_alignment_and_labelled(server, sent):
    corners = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]], [[0, 0, 5], [1, 0, 5], [1, 1, 5], [0, 1, 5.0]]])
    tags = TagCorners(np.array([3, 11]), corners, np.array([2, 2]), np.zeros(2))
    layer = TagsLayer(server.scene, "sfm", SCAN_TAGS, suffix="'")
    layer.show(tags)
    assert {"/tags/sfm/3", "/tags/sfm/11", "/tags/sfm-outlines"} <= names(server)
    assert server.scene._handle_from_node_name["/tags/sfm/11"].text == "11'"
    sent.clear()
    layer.show(tags)
    assert not any(kind in ("GlbMessage", "LabelMessage") for kind, _ in sent)
    layer.show(tags, SIMILARITY)
    assert not any(kind == "GlbMessage" for kind, _ in sent)
    label = server.scene._handle_from_node_name["/tags/sfm/3"]
    np.testing.assert_allclose(label.position, SIMILARITY.apply([0.5, 0.5, 0]), atol=1e-6)
    layer.show(None)
    assert not {"/tags/sfm/3", "/tags/sfm/11", "/tags/sfm-outlines"} & names(server)


def test_keypoints_change_one_by_one(server, sent):
    layer = KeypointsLayer(server.scene)
    pairs = KeypointSet((KeypointPair("k1", "desk", (1, 1, 1), (0, 0, 0)), KeypointPair("k2", "door", None, (1, 0, 0))))
    layer.show(pairs, None)
    assert {name for name in names(server) if name.startswith("/keypoints/") and name.count("/") == 3} == {
        "/keypoints/k1/scan",
        "/keypoints/k1/label",
    }
    layer.show(pairs, SIMILARITY)
    node = server.scene._handle_from_node_name["/keypoints/k2/sfm"]
    np.testing.assert_allclose(node.position, SIMILARITY.apply([1, 0, 0]))
    assert "/keypoints/k1/residual" in names(server)
    assert "/keypoints/k2/residual" not in names(server)
    sent.clear()
    layer.show(pairs, SIMILARITY)
    assert sent == []
    layer.show(pairs, SIMILARITY, selected="k2")
    assert {name.split("/")[2] for _, name in sent if name.startswith("/keypoints/")} == {"k2"}
    assert server.scene._handle_from_node_name["/keypoints/k2/sfm"].color == SELECTED
    layer.show(pairs.remove("k1"), SIMILARITY)
    assert not any(name.startswith("/keypoints/k1/") for name in names(server))


def test_what_is_hidden_stays_hidden_when_it_changes(server, sent):
    layer = KeypointsLayer(server.scene)
    layer.set_visible(False)
    layer.show(KeypointSet((KeypointPair("k1", "desk", (1, 1, 1)),)), None)
    assert not server.scene._handle_from_node_name["/keypoints/k1/scan"].visible


@pytest.mark.parametrize(("up_axis", "floor"), [("z", -0.995), ("-z", 2.395), ("y", -2.995)])
def test_the_grid_lies_on_the_floor_in_whole_metres(server, sent, up_axis, floor):
    low, high = np.array([0.2, -3.0, -1.0]), np.array([3.4, 1.0, 2.4])
    height = "xyz".index(up_axis[-1])
    lines, colors = grid_lines(low, high, up_axis)
    ground = np.delete(lines[:-3], height, axis=2)
    np.testing.assert_allclose(lines[:-3, :, height], floor)
    np.testing.assert_array_equal(ground, np.rint(ground))
    assert (ground.min(axis=(0, 1)) <= np.delete(low, height)).all()
    assert (ground.max(axis=(0, 1)) >= np.delete(high, height)).all()
    np.testing.assert_allclose(lines[-3:, 1] - lines[-3:, 0], np.eye(3))
    assert len(colors) == len(lines)
    layer = GridLayer(server.scene)
    layer.set_visible(False)
    layer.show(low, high, up_axis)
    assert {"/grid", "/grid-x", "/grid-y", "/grid-z"} <= names(server)
    assert not server.scene._handle_from_node_name["/grid"].visible
    assert "".join(node.text for node in layer._nodes[1:] if len(node.text) > 1) in (f"{up_axis} ↑", f"{up_axis[1:]} ↓")


def test_the_grid_of_a_very_large_scan_has_squares_of_ten_metres(server):
    lines, _ = grid_lines(np.array([-3.0, 0.0, 2.0]), np.array([480.0, 9.0, 130.0]), "y")
    assert len(lines) < 100
    np.testing.assert_array_equal(np.unique(lines[:-3, 0, 2]), np.arange(0, 131, 10))
    np.testing.assert_allclose(lines[-3:, 1] - lines[-3:, 0], 10 * np.eye(3))


@pytest.mark.parametrize(("size_m", "factor"), [((0.6, 0.9, 0.5), 0.3), ((4, 2.6, 3), 1.0), ((12, 4, 9), 1.3)])
def test_markers_are_as_large_as_the_room_asks_for(server, size_m, factor):
    found = size_factor(np.zeros(3), np.array(size_m))
    assert found == pytest.approx(factor, rel=0.05)
    keypoints, gaze = KeypointsLayer(server.scene, radius_m=0.025), GazeLayer(server.scene)
    keypoints.size = gaze.size = found
    keypoints.show(KeypointSet((KeypointPair("k1", "desk", (1, 1, 1)),)), None)
    gaze.show(np.zeros(3), hit=np.array([0, 0, 1.5]))
    assert server.scene._handle_from_node_name["/keypoints/k1/scan"].radius == pytest.approx(0.025 * found)
    assert server.scene._handle_from_node_name["/gaze/hit"].radius == pytest.approx(0.035 * found)
    keypoints.show(KeypointSet(()), None)
    gaze.show(None)


def test_gaze_shows_a_hit_only_where_there_is_one(server, sent):
    layer = GazeLayer(server.scene)
    layer.show(np.zeros(3), np.array([0, 0, 2.0]))
    assert "/gaze/ray" in names(server)
    assert "/gaze/hit" not in names(server)
    np.testing.assert_allclose(server.scene._handle_from_node_name["/gaze/ray"].points, [[[0, 0, 0], [0, 0, 5]]])
    layer.show(np.zeros(3), hit=np.array([0, 0, 1.5]))
    np.testing.assert_allclose(server.scene._handle_from_node_name["/gaze/hit"].position, [0, 0, 1.5])
    layer.show(None)
    assert not any(name in names(server) for name in ("/gaze/ray", "/gaze/hit"))


def test_the_selected_frame_is_one_frustum(server, sent):
    layer = SelectedFrameLayer(server.scene)
    pose = RigidTransform.identity()
    layer.show(pose, CAMERA)
    node = server.scene._handle_from_node_name["/selected"]
    assert node.fov == pytest.approx(2 * np.arctan(120 / 250))
    assert node.aspect == pytest.approx((320 / 260) / (240 / 250))
    layer.show(None, None)
    assert "/selected" not in names(server)


def test_the_picture_stands_where_its_corners_project(server, sent):
    width, height, centre = picture_plane(CAMERA, 0.5)
    corners = centre + np.array([[-width / 2, -height / 2, 0], [width / 2, height / 2, 0]])
    np.testing.assert_allclose(CAMERA.project(corners), [[0, 0], [320, 240]], atol=1e-9)
    layer = FrameInSceneLayer(server.scene)
    layer.show(RigidTransform.identity(), CAMERA, np.zeros((240, 320, 3), np.uint8))
    assert "/picture" in names(server)
    layer.show(None, None, None)
    assert "/picture" not in names(server)


def test_looking_through_a_camera_shows_all_of_its_picture():
    view = look_through(RigidTransform.identity(), CAMERA)
    assert np.tan(view.fov_rad / 2) > max(112, 240 - 112) / 250


@pytest.mark.parametrize(("axis", "vector"), [("y", [0, 1, 0]), ("-y", [0, -1, 0]), ("z", [0, 0, 1]), ("x", [1, 0, 0])])
def test_the_overview_is_from_above_and_has_the_room_in_it(server, sent, axis, vector):
    np.testing.assert_array_equal(up_vector(axis), vector)
    far_off = Mesh(np.concatenate([np.repeat(BOX.vertices, 100, axis=0), [[500.0, 0, 0]]]), BOX.faces)
    eye, target = overview(far_off, axis)
    forward = (target - eye) / np.linalg.norm(target - eye)
    assert forward @ vector < -0.4
    right = np.cross(forward, vector) / np.linalg.norm(np.cross(forward, vector))
    to_corners = BOX.vertices - eye
    x, y = to_corners @ right, to_corners @ np.cross(forward, right)
    depth = to_corners @ forward
    assert 0.8 < (np.maximum(np.abs(x) / 0.8, np.abs(y)) / depth / np.tan(FOV_RAD / 2)).max() < 1
    set_start(server, BOX, axis)
    np.testing.assert_allclose(server.initial_camera.position, overview(BOX, axis)[0])
