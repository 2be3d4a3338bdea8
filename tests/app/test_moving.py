"""Keypoints that snap to tags, are nudged by keys and dragged by the mouse, on a wall whose geometry is known."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from gazeloc_app.actions.history import Undo
from gazeloc_app.actions.picks import MovePoint, PickPoint, Side
from gazeloc_app.keypoints.dragging import Cloud, Dragging
from gazeloc_app.keypoints.moving import ARROWS, Nudge, dragged, nudged, nudged_in_view
from gazeloc_app.keypoints.snapping import snap
from gazeloc_app.scene.kept import EVERYTHING, Kept, Plane
from gazeloc_app.state import AppState, Level
from scipy.spatial.transform import Rotation

from gazeloc_core.keypoints import Sighting
from gazeloc_core.scan import Mesh
from gazeloc_core.surfaces.raycast import Raycaster
from gazeloc_core.tag_types import TagCorners
from gazeloc_core.transforms import Similarity

FORWARD = np.array([1.0, 0, 0, 0])
"""A camera whose x is right, y down, z forward, as the scan's axes."""
EYE = np.zeros(3)


def wall(slope=0.0):
    """A large square before the eye at z = 3, its right side farther away by the slope."""
    corners = np.array([[x, y, 3.0 + slope * x] for x, y in ((-4, -4), (4, -4), (4, 4), (-4, 4))], float)
    return Raycaster(Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]])))


def tag(at=(0.0, 0.0, 3.0), size=0.2):
    corners = np.array(at) + size / 2 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    return TagCorners(np.array([7]), corners[None], np.array([4]), np.array([0.001]))


@pytest.mark.parametrize("slope", [0.0, 1.5])
@pytest.mark.parametrize("key", ARROWS)
def test_a_nudge_goes_its_length_along_the_surface_in_the_direction_of_the_screen(slope, key):
    start = (0.0, 0.0, 3.0)
    moved = np.array(nudged(wall(slope), start, Nudge(ARROWS[key], 0.01), FORWARD))
    assert np.linalg.norm(moved - start) == pytest.approx(0.01, abs=5e-6)  # Embree counts in single precision
    assert moved[2] == pytest.approx(3.0 + slope * moved[0], abs=5e-6)
    on_screen = moved[:2] / moved[2]
    assert on_screen @ ARROWS[key] > 0


def test_a_turned_view_turns_the_arrows():
    rolled = Rotation.from_euler("z", 90, degrees=True).as_quat()[[3, 0, 1, 2]]
    moved = nudged(wall(), (0.0, 0.0, 3.0), Nudge((1, 0), 0.01), rolled)
    np.testing.assert_allclose(moved, (0, 0.01, 3), atol=1e-6)


def test_a_drag_ends_on_the_surface_under_the_pointer():
    np.testing.assert_allclose(dragged(wall(), EYE, np.array([0.1, 0.2, 1.0]), 0), (0.3, 0.6, 3.0), atol=1e-6)
    assert dragged(wall(), EYE, np.array([0.1, 0.2, -1.0]), 0) is None
    assert dragged(wall(), EYE, EYE, 0) is None


def drag(state, *pointers, side=Side.SCAN, cloud=None, kept=EVERYTHING):
    """The state after a drag of k1's marker over these pointers, and where the marker went."""
    box = SimpleNamespace(state=state)

    def dispatch(action):
        box.state = action.apply(box.state)

    data = SimpleNamespace(raycaster=wall)
    dragging = Dragging(data, lambda: 0, dispatch, {5: kept}.get)
    dragging.cloud = cloud
    marker = SimpleNamespace(position=np.array(side.point_of(state.annotation.keypoints.pairs[0])))
    client = SimpleNamespace(client_id=5, camera=SimpleNamespace(position=EYE, fov=0.8, image_height=800))
    phases = ["start", *["update"] * (len(pointers) - 2), "end"]
    for phase, pointer in zip(phases, pointers, strict=True):
        dragging(side, "k1", SimpleNamespace(target=marker, phase=phase, client=client, end_position=pointer))
    return box.state, marker.position


def test_a_drag_is_one_step_and_moves_the_marker_on_the_way():
    state = PickPoint(Side.SCAN, (0.0, 0.0, 3.0)).apply(AppState(("walk",), "walk"))
    steps = len(state.past)
    after, marker = drag(state, (0, 0, 1), (0.05, 0, 1), (0.1, 0, 1), (0.1, 0.1, 1))
    np.testing.assert_allclose(after.annotation.keypoints.pairs[0].scan, (0.3, 0.3, 3), atol=1e-6)
    np.testing.assert_allclose(marker, (0.3, 0.3, 3), atol=1e-6)
    assert len(after.past) == steps + 1
    assert Undo().apply(after).annotation == state.annotation


SFM_FROM_SCAN = Similarity(0.5, Rotation.from_euler("y", 40, degrees=True), np.array([1.0, 0, 0]))


def test_in_the_reconstruction_a_drag_takes_the_point_of_the_cloud_where_it_ends_and_else_stays_in_the_view():
    in_scan = np.array([[0.3, 0.3, 4.0], [0.0, 0.0, 2.0]])
    cloud = Cloud(SimpleNamespace(points=SFM_FROM_SCAN.apply(in_scan)), SFM_FROM_SCAN.inverse())
    began = PickPoint(Side.SFM, tuple(SFM_FROM_SCAN.apply([0.2, 0.2, 3.0]).tolist())).apply(AppState(("walk",), "walk"))
    near = np.array([0.3, 0.302, 4.0]) * 3 / 4  # less than a pixel beside the first point
    after, _ = drag(began, (0.2, 0.2, 3), (0.1, 0.2, 3), near, side=Side.SFM, cloud=cloud)
    np.testing.assert_allclose(after.annotation.keypoints.pairs[0].sfm, cloud.model.points[0])
    assert len(after.past) == len(began.past) + 1
    after, marker = drag(began, (0.2, 0.2, 3), (0.5, -0.4, 3), (0.5, -0.4, 3), side=Side.SFM, cloud=cloud)
    np.testing.assert_allclose(after.annotation.keypoints.pairs[0].sfm, SFM_FROM_SCAN.apply([0.5, -0.4, 3]))
    np.testing.assert_allclose(marker, (0.5, -0.4, 3))
    after, _ = drag(began, (0.2, 0.2, 3), (np.nan, 0, 3), (np.nan, 0, 3), side=Side.SFM, cloud=cloud)
    assert after.annotation == began.annotation


def test_a_drag_off_the_scan_goes_back_and_says_so():
    state = PickPoint(Side.SCAN, (0.0, 0.0, 3.0)).apply(AppState(("walk",), "walk"))
    after, marker = drag(state, (0, 0, -1), (0, 0, -1), (0, 0, -1))
    assert after.annotation == state.annotation
    assert after.notice.level is Level.INFO
    np.testing.assert_allclose(marker, (0, 0, 3))


def test_in_the_view_a_nudge_goes_its_length_across_it():
    rolled = Rotation.from_euler("z", 90, degrees=True).as_quat()[[3, 0, 1, 2]]
    np.testing.assert_allclose(nudged_in_view(np.array([1.0, 2, 3]), Nudge((0, 1), 0.002), rolled), (0.998, 2, 3))


def test_a_marker_that_is_cut_away_is_not_in_the_hand_and_one_that_is_not_goes_nowhere_beyond_the_cut():
    state = PickPoint(Side.SCAN, (0.0, 0.0, 3.0)).apply(AppState(("walk",), "walk"))
    over = ((0, 0, 1), (0.1, 0, 1), (0.1, 0.1, 1))
    after, marker = drag(state, *over, kept=Kept((Plane((0, 0, 1), 2.0),)))
    assert after is state
    np.testing.assert_allclose(marker, (0, 0, 3))
    after, _ = drag(state, *over, kept=Kept((Plane((1, 0, 0), 0.2),)))
    assert after.annotation == state.annotation
    after, _ = drag(state, *over, kept=Kept((Plane((1, 0, 0), 0.4),)))
    np.testing.assert_allclose(after.annotation.keypoints.pairs[0].scan, (0.3, 0.3, 3), atol=1e-6)


def test_in_the_reconstruction_a_drag_takes_no_point_that_is_cut_away():
    cloud = Cloud(SimpleNamespace(points=np.array([[0.3, 0.3, 4.0], [0.0, 0.0, 2.0]])), Similarity.identity())
    began = PickPoint(Side.SFM, (0.2, 0.2, 3.0)).apply(AppState(("walk",), "walk"))
    near, below = np.array([0.3, 0.302, 4.0]) * 3 / 4, Kept((Plane((0, 0, 1), 3.5),))
    after, _ = drag(began, (0.2, 0.2, 3), (0.1, 0.2, 3), near, side=Side.SFM, cloud=cloud, kept=below)
    np.testing.assert_allclose(after.annotation.keypoints.pairs[0].sfm, near)


def test_moving_a_pair_that_is_gone_or_has_no_place_on_the_scan_changes_nothing():
    state = PickPoint(Side.SFM, (1, 2, 3)).apply(AppState(("walk",), "walk"))
    assert MovePoint("k1", (0, 0, 0)).apply(state) is state
    assert MovePoint("k9", (0, 0, 0)).apply(state) is state
    (pair,) = MovePoint("k1", (0, 0, 0), Side.SFM).apply(state).annotation.keypoints
    assert pair.sfm == (0, 0, 0)


def test_a_moved_point_no_longer_rests_on_clicks_in_frames():
    state = PickPoint(Side.SCAN, (1, 2, 3)).apply(AppState(("walk",), "walk"))
    clicked = state.annotation.keypoints.change("k1", scan_sightings=(Sighting(0, 1.0, 2.0),), scan_sigma=0.01)
    (pair,) = MovePoint("k1", (0, 0, 0)).apply(state.with_keypoints(clicked)).annotation.keypoints
    assert (pair.scan, pair.scan_sightings, pair.scan_sigma) == ((0, 0, 0), (), None)


def test_a_click_near_a_tags_corner_or_centre_means_it_and_names_the_pair():
    here = Similarity.identity()
    for beside, name in (((0.004, 0, 3.0), "Tag 7, centre"), ((0.102, 0.1, 3.0), "Tag 7, corner 3")):
        found = snap(tag(), here, EYE, np.array(beside), 0.01)
        assert found.name == name
    assert snap(tag(), here, EYE, np.array([0.05, 0.0, 3.0]), 0.01) is None
    assert snap(None, here, EYE, np.array([0.0, 0.0, 3.0]), 0.01) is None
    named = PickPoint(Side.SCAN, (0, 0, 3), name="Tag 7, centre").apply(AppState(("walk",), "walk"))
    assert named.annotation.keypoints.pairs[0].name == "Tag 7, centre"
    completed = PickPoint(Side.SFM, (1, 1, 1), name="Tag 8, centre").apply(named)
    assert completed.annotation.keypoints.pairs[0].name == "Tag 7, centre"  # it has a name


def test_a_tag_behind_what_was_clicked_is_not_meant_and_tags_are_where_the_alignment_puts_them():
    here = Similarity.identity()
    assert snap(tag((0, 0, 4.0)), here, EYE, np.array([0, 0, 1.0]), 0.01, np.array([0, 0, 3.0])) is None
    assert snap(tag((0, 0, 3.05)), here, EYE, np.array([0, 0, 1.0]), 0.01, np.array([0, 0, 3.0])) is not None
    moved = Similarity(2.0, Rotation.identity(), np.array([0.0, 0, -3.0]))
    found = snap(tag(), moved, EYE, np.array([0, 0, 1.0]), 0.01)
    np.testing.assert_allclose(found.point, (0, 0, 3))
