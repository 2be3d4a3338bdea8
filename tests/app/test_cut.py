"""Cutting the scan open: what is left, what the page is told, and clicks that pass what is cut away."""

import numpy as np
import pytest
from gazeloc_app.keypoints.picking import pick_cloud, pick_frustum, pick_mesh
from gazeloc_app.keypoints.snapping import snap
from gazeloc_app.routes import Routes
from gazeloc_app.scene.cut import Cut
from gazeloc_app.scene.kept import EVERYTHING, Kept, Plane
from gazeloc_app.server import make_server
from scipy.spatial.transform import Rotation

from gazeloc_core.scan import Mesh
from gazeloc_core.surfaces.raycast import Raycaster
from gazeloc_core.tag_types import TagCorners
from gazeloc_core.transforms import Similarity

LOW, HIGH = np.array([-1.0, -2.0, 0.5]), np.array([3.0, 2.0, 3.0])


@pytest.fixture(scope="module")
def server():
    server = make_server(0, Routes())
    yield server
    server.stop()


@pytest.fixture
def cut(server):
    """A server's own interface has what the cut needs of a client's."""
    yield lambda up_axis: Cut(server, LOW, HIGH, up_axis)
    server.scene.reset()
    server.gui.reset()


def move(cut, number, *value):
    cut._sliders[number][0].value = value
    cut._changed()


def test_nothing_is_cut_at_the_ends(cut, server):
    whole = cut("z")
    assert whole.kept.planes == ()
    assert whole.kept.has(np.array([99.0, 99, 99]))
    move(whole, 0, 0.0, 1.0)
    assert len(whole.kept.planes) == 1
    whole._undo()
    assert whole.kept.planes == ()
    assert not [name for name in server.scene._handle_from_node_name if name.startswith("/cut/")]


@pytest.mark.parametrize(
    ("up_axis", "kept", "gone"),
    [("z", (0, 0, 1.4), (0, 0, 1.6)), ("-z", (0, 0, 2.1), (0, 0, 1.9)), ("y", (0, -1.1, 2), (0, -0.9, 2))],
)
def test_the_first_slider_cuts_above_a_height_whichever_way_is_up(cut, up_axis, kept, gone):
    opened = cut(up_axis)
    move(opened, 0, 0.0, 1.0)
    assert opened.kept.has(np.array(kept))
    assert not opened.kept.has(np.array(gone))


def test_a_box_is_left_between_both_ends_of_all_sliders(cut):
    box = cut("z")
    for number in range(3):
        move(box, number, 1.0, 2.0)
    assert len(box.kept.planes) == 6
    inside = LOW + 1.5
    assert box.kept.has(inside)
    for axis in range(3):
        for side in (-0.6, 0.6):
            assert not box.kept.has(inside + side * np.eye(3)[axis])


def test_the_pages_nodes_lie_in_the_planes_with_z_towards_what_is_cut_away(cut, server):
    opened = cut("z")
    move(opened, 1, 1.0, 2.0)
    nodes = [node for name, node in server.scene._handle_from_node_name.items() if name.startswith("/cut/")]
    assert len(nodes) == len(opened.kept.planes) == 2
    for node, plane in zip(nodes, opened.kept.planes, strict=True):
        z = Rotation.from_quat(node.wxyz, scalar_first=True).apply([0, 0, 1])
        np.testing.assert_allclose(z, plane.normal, atol=1e-9)
        assert float(z @ node.position) == pytest.approx(plane.offset)


def test_values_that_no_slider_gives_are_brought_into_its_range(cut):
    opened = cut("z")
    move(opened, 0, 1e9, -1e9)
    assert opened.kept.planes == ()


BELOW = Kept((Plane((0, 0, 1), 2.0),))
EYE, DOWN = np.array([0.2, 0.2, 5.0]), np.array([0.0, 0, -1])


def squares(*heights):
    """A triangle at each height, over the eye's foot."""
    corners = [[[0, 0, z], [1, 0, z], [0, 1, z]] for z in heights]
    return Mesh(np.reshape(corners, (-1, 3)), np.arange(3 * len(heights)).reshape(-1, 3))


def test_a_click_passes_what_is_cut_away_however_much_it_is():
    raycaster = Raycaster(squares(*np.linspace(2.1, 4.9, 200), 1.0))
    np.testing.assert_allclose(pick_mesh(raycaster, EYE, DOWN), [0.2, 0.2, 4.9], atol=1e-6)
    np.testing.assert_allclose(pick_mesh(raycaster, EYE, DOWN, 0, BELOW), [0.2, 0.2, 1], atol=1e-6)
    assert pick_mesh(raycaster, EYE, -DOWN, 0, BELOW) is None
    assert pick_mesh(raycaster, [0.2, 0.2, 1.5], -DOWN, 0, BELOW) is None


def test_a_point_a_camera_and_a_tag_that_are_cut_away_are_not_meant():
    stack = np.array([[0.2, 0.2, 3.0], [0.2, 0.2, 1.0]])
    assert pick_cloud(stack, EYE, DOWN, 0.01) == 0
    assert pick_cloud(stack, EYE, DOWN, 0.01, BELOW) == 1
    assert pick_cloud(stack[:1], EYE, DOWN, 0.01, BELOW) is None
    forward = np.tile([1.0, 0, 0], (2, 1))
    assert pick_frustum(stack, forward, EYE, DOWN, 0.1, 0.01) == 0
    assert pick_frustum(stack, forward, EYE, DOWN, 0.1, 0.01, BELOW) == 1
    assert pick_frustum(stack[:1], forward[:1], EYE, DOWN, 0.1, 0.01, BELOW) is None
    corners = stack[:, None] + 0.1 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    tags = TagCorners(np.array([3, 4]), corners, np.array([5, 5]), np.array([0.001, 0.001]))
    for number, kept in ((3, EVERYTHING), (4, BELOW)):
        found = snap(tags, Similarity.identity(), EYE, DOWN, 0.01, kept=kept)
        assert found is not None
        assert found.name == f"Tag {number}, centre"


@pytest.mark.parametrize("seed", range(20))
def test_where_a_ray_begins_everything_before_is_cut_away_and_the_place_itself_is_left(seed):
    rng = np.random.default_rng(seed)
    planes = tuple(Plane(tuple((n / np.linalg.norm(n)).tolist()), 0.3) for n in rng.normal(size=(3, 3)))
    kept, start, ray = Kept(planes), 3 * rng.normal(size=3), rng.normal(size=3)
    along = np.linspace(0, 20, 4001)
    left = kept.has(start + along[:, None] * ray)
    begin = kept.begin(start, ray)
    if begin is None:
        assert not left.any()
        return
    reached = float((begin - start) @ ray / (ray @ ray))
    assert not left[along < reached - 1e-9].any()
    assert kept.has(begin + 1e-9 * ray) or reached > 20 or not left.any()
