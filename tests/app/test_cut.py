"""Cutting the scan open: what is left, what the page is told, and clicks that pass what is cut away."""

import numpy as np
import pytest
from gazeloc_app.cut import Cut, Plane
from gazeloc_app.keypoints.picking import pick_mesh
from gazeloc_app.routes import Routes
from gazeloc_app.server import make_server
from scipy.spatial.transform import Rotation

from gazeloc_core.raycast import Raycaster
from gazeloc_core.scan import Mesh

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
    assert whole.planes == ()
    assert whole.leaves(np.array([99.0, 99, 99]))
    move(whole, 0, 0.0, 1.0)
    assert len(whole.planes) == 1
    whole._undo()
    assert whole.planes == ()
    assert not [name for name in server.scene._handle_from_node_name if name.startswith("/cut/")]


@pytest.mark.parametrize(
    ("up_axis", "kept", "gone"),
    [("z", (0, 0, 1.4), (0, 0, 1.6)), ("-z", (0, 0, 2.1), (0, 0, 1.9)), ("y", (0, -1.1, 2), (0, -0.9, 2))],
)
def test_the_first_slider_cuts_above_a_height_whichever_way_is_up(cut, up_axis, kept, gone):
    opened = cut(up_axis)
    move(opened, 0, 0.0, 1.0)
    assert opened.leaves(np.array(kept))
    assert not opened.leaves(np.array(gone))


def test_a_box_is_left_between_both_ends_of_all_sliders(cut):
    box = cut("z")
    for number in range(3):
        move(box, number, 1.0, 2.0)
    assert len(box.planes) == 6
    inside = LOW + 1.5
    assert box.leaves(inside)
    for axis in range(3):
        for side in (-0.6, 0.6):
            assert not box.leaves(inside + side * np.eye(3)[axis])


def test_the_pages_nodes_lie_in_the_planes_with_z_towards_what_is_cut_away(cut, server):
    opened = cut("z")
    move(opened, 1, 1.0, 2.0)
    nodes = [node for name, node in server.scene._handle_from_node_name.items() if name.startswith("/cut/")]
    assert len(nodes) == len(opened.planes) == 2
    for node, plane in zip(nodes, opened.planes, strict=True):
        z = Rotation.from_quat(node.wxyz, scalar_first=True).apply([0, 0, 1])
        np.testing.assert_allclose(z, plane.normal, atol=1e-9)
        assert float(z @ node.position) == pytest.approx(plane.offset)


def test_values_that_no_slider_gives_are_brought_into_its_range(cut):
    opened = cut("z")
    move(opened, 0, 1e9, -1e9)
    assert opened.planes == ()


def test_a_click_passes_what_is_cut_away():
    squares = [[[0, 0, z], [1, 0, z], [0, 1, z]] for z in (3.0, 1.0)]
    mesh = Mesh(np.reshape(squares, (-1, 3)), np.arange(6).reshape(2, 3))
    raycaster, below = Raycaster(mesh), Plane((0, 0, 1), 2.0)
    eye, down = [0.2, 0.2, 5], [0, 0, -1]
    np.testing.assert_allclose(pick_mesh(raycaster, eye, down), [0.2, 0.2, 3], atol=1e-6)
    np.testing.assert_allclose(pick_mesh(raycaster, eye, down, 0, below.contains), [0.2, 0.2, 1], atol=1e-6)
