"""Surfaces from sparse points lie where the room is, face the cameras, and carry the points' colours."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from sighted_room import sighted_room

from gazeloc_core.errors import GeometryError
from gazeloc_core.surfaces.clouds import sample_surface
from gazeloc_core.surfaces.meshing import (
    DelaunayOptions,
    SurfacePointOptions,
    delaunay_surface,
    poisson_surface,
    sighted_points,
    towards_cameras,
)
from gazeloc_core.surfaces.raycast import Raycaster
from gazeloc_core.transforms import Similarity

BOTH = [poisson_surface, delaunay_surface]


@pytest.fixture(scope="module")
def room():
    return sighted_room(points=8000, point_noise_m=0.004, seed=2)


@pytest.fixture(scope="module", params=BOTH, ids=lambda make: make.__name__)
def made(request, room):
    return request.param(room.model)


def in_scan(room, mesh, count=5000):
    """Points on a surface, in the scan."""
    return room.scan_from_sfm.apply(sample_surface(mesh, count, 0))


def test_the_surface_lies_on_the_room(room, made):
    off = Raycaster(room.mesh).closest(in_scan(room, made)).distance
    assert np.median(off) < 0.01
    assert np.percentile(off, 80) < 0.05  # points are 8 cm apart
    assert np.percentile(off, 95) < 0.12


def test_the_surface_covers_what_the_cameras_saw(room, made):
    seen = np.unique(room.model.observation_point)
    off = Raycaster(made).closest(room.model.points[seen]).distance * room.scan_from_sfm.scale
    assert np.percentile(off, 90) < 0.03


def test_the_surface_faces_the_room(room, made):
    corners = room.scan_from_sfm.apply(made.vertices)[made.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    middles = corners.mean(axis=1)
    raycaster = Raycaster(room.mesh)
    outward = raycaster.normals(raycaster.closest(middles))  # the walls' own; furniture is inside of them
    on_wall = np.isclose(np.abs(middles), (2.5, 1.3, 2.0), atol=0.02).any(axis=1)
    area = np.linalg.norm(normals, axis=1)
    inward = np.sum(normals * outward, axis=1) < 0
    assert area[on_wall & inward].sum() > 0.97 * area[on_wall].sum()


def test_vertices_have_the_colours_of_the_points(room, made):
    expected = np.clip(128 + 40 * room.scan_from_sfm.apply(made.vertices), 0, 255)
    assert np.median(np.abs(made.colors - expected)) < 3


@pytest.mark.parametrize("make", BOTH)
def test_the_surface_does_not_depend_on_the_reconstructions_own_scale_and_axes(room, make):
    other = Similarity(30.0, Rotation.from_rotvec([0.4, 1.0, -0.2]), np.array([50.0, -7.0, 3.0]))
    moved = replace(
        room.model,
        points=other.apply(room.model.points),
        sfm_from_camera=other.compose_pose(room.model.sfm_from_camera),
    )
    first, second = make(room.model), make(moved)
    back = other.inverse().apply(sample_surface(second, 3000, 1))
    assert np.percentile(Raycaster(first).closest(back).distance, 95) * room.scan_from_sfm.scale < 0.02
    assert len(second.faces) == pytest.approx(len(first.faces), rel=0.15)


def test_the_same_points_give_the_same_surface_to_the_last_bit(room, made, request):
    again = request.node.callspec.params["made"](room.model)
    np.testing.assert_array_equal(again.vertices, made.vertices)
    np.testing.assert_array_equal(again.faces, made.faces)


def test_cameras_that_see_no_room_before_them_are_a_sentence(room):
    """Lines of sight that end before they reach any point: nothing is known to be empty."""
    outside = Similarity(1.0, Rotation.identity(), np.full(3, 100.0)).compose_pose(room.model.sfm_from_camera)
    with pytest.raises(GeometryError, match="leave no surface"):
        delaunay_surface(replace(room.model, sfm_from_camera=outside), DelaunayOptions(stop_spacings=1e9))


def test_points_that_are_alone_or_badly_measured_take_no_part(room):
    model = room.model
    alone = np.unique(model.observation_point)[:16]
    points = model.points.copy()
    points[alone] = room.scan_from_sfm.inverse().apply(np.random.default_rng(0).uniform(4, 9, (16, 3)))
    tracks, errors = model.track_lengths.copy(), model.point_errors_px.copy()
    short, blurred = np.unique(model.observation_point)[40:60], np.unique(model.observation_point)[60:80]
    tracks[short], errors[blurred] = 2, 9.0
    seen = sighted_points(replace(model, points=points, track_lengths=tracks, point_errors_px=errors))
    left = {tuple(point) for point in seen.points}
    assert not left & {tuple(point) for point in points[np.concatenate([short, blurred])]}
    assert not left & {tuple(point) for point in points[alone]}
    assert len(left) > 0.9 * (len(np.unique(model.observation_point)) - 80)


def test_sights_name_the_cameras_of_the_points_that_are_left(room):
    seen = sighted_points(room.model)
    row = int(np.flatnonzero(seen.sight_point == 17)[0])
    point = int(np.flatnonzero((room.model.points == seen.points[17]).all(axis=1))[0])
    images = room.model.observation_image[room.model.observation_point == point]
    centres = room.model.sfm_from_camera.translation[images]
    assert (np.abs(centres - seen.sight_from[row]).max(axis=1) < 1e-12).any()
    assert (seen.sight_point == 17).sum() == len(images)


def test_normals_turn_to_the_side_that_sees_the_point(room):
    seen = sighted_points(room.model)
    rng = np.random.default_rng(3)
    normals = rng.normal(size=seen.points.shape)
    turned = towards_cameras(seen, normals)
    np.testing.assert_array_equal(np.abs(turned), np.abs(normals))
    np.testing.assert_array_equal(towards_cameras(seen, -normals), turned)
    for point in rng.integers(0, len(seen.points), 50):
        views = seen.sight_from[seen.sight_point == point] - seen.points[point]
        assert (views / np.linalg.norm(views, axis=1, keepdims=True)).sum(axis=0) @ turned[point] > 0


def without_observations(model):
    nothing = np.zeros(0, int)
    return replace(model, observation_point=nothing, observation_image=nothing, observation_px=np.zeros((0, 2)))


@pytest.mark.parametrize("make", BOTH)
@pytest.mark.parametrize(
    "spoil",
    [
        without_observations,
        lambda model: replace(model, point_errors_px=np.full(len(model.points), 50.0)),
        lambda model: replace(model, track_lengths=np.full(len(model.points), 1)),
    ],
    ids=["unseen", "blurred", "short"],
)
def test_too_few_good_points_are_a_sentence(room, make, spoil):
    with pytest.raises(GeometryError, match="Only 0 of the reconstruction's 8000 points"):
        make(spoil(room.model))


def test_points_in_one_plane_are_a_sentence(room):
    flat = room.model.points * (1, 1, 0)
    with pytest.raises(GeometryError, match="lie in one plane"):
        delaunay_surface(replace(room.model, points=flat))


def test_the_least_number_of_points_is_an_option(room):
    with pytest.raises(GeometryError, match="needs 9000"):
        sighted_points(room.model, SurfacePointOptions(least_points=9000))
