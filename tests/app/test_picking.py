"""Picking to exactness: rays and points whose answer is known."""

import numpy as np
import pytest
from gazeloc_app.keypoints import picking
from scipy.spatial.transform import RigidTransform, Rotation

from gazeloc_core.camera import Camera
from gazeloc_core.scan import Mesh
from gazeloc_core.surfaces.raycast import Raycaster

CAMERA = Camera.pinhole(1280, 960, 900.0, 905.0, 650.0, 470.0)
POSE = RigidTransform.from_components([1.0, -2.0, 0.5], Rotation.from_euler("xyz", [20, 130, -35], degrees=True))


def test_the_tolerance_is_the_angle_of_so_many_pixels():
    camera = Camera.pinhole(800, 600, 700, 700, 400, 300)
    ray = camera.unproject([[400, 308]])[0]
    fov = 2 * np.arctan(300 / 700)
    assert picking.tolerance_rad(fov, 600, 8) == pytest.approx(np.arccos(ray[2]), abs=1e-12)


def test_a_ray_meets_the_mesh_at_the_front_most_face_or_not_at_all():
    wall = np.array([[-1, -1, 0], [1, -1, 0], [0, 2, 0]], float)
    mesh = Mesh(np.concatenate([np.add(wall, (0, 0, 3)), np.add(wall, (0, 0, 2))]), np.array([[0, 1, 2], [3, 4, 5]]))
    raycaster = Raycaster(mesh)
    np.testing.assert_allclose(picking.pick_mesh(raycaster, (0.1, 0.2, 0), (0, 0, 0.5)), [0.1, 0.2, 2], atol=1e-6)
    assert picking.pick_mesh(raycaster, (0.1, 0.2, 0), (0, 0, -1)) is None
    assert picking.pick_mesh(raycaster, (5, 0, 0), (0, 0, 1)) is None


@pytest.mark.parametrize("length", [1e-3, 1.0, 50.0])
def test_the_front_most_point_within_the_tolerance_is_picked(length):
    tolerance = 0.01
    points = np.array(
        [
            [0.0, 0.0, 5.0],  # right on the ray, but hidden by the next
            [0.009 * 2, 0.0, 2.0],
            [0.02 * 1, 0.0, 1.0],  # nearer still, but beside
            [0.0, 0.0, -1.0],  # behind
        ]
    )
    assert picking.pick_cloud(points, (0, 0, 0), (0, 0, length), tolerance) == 1
    assert picking.pick_cloud(points[[0, 2]], (0, 0, 0), (0, 0, length), tolerance) == 0
    assert picking.pick_cloud(points[2:], (0, 0, 0), (0, 0, length), tolerance) is None
    assert picking.pick_cloud(np.zeros((0, 3)), (0, 0, 0), (0, 0, length), tolerance) is None


def test_of_points_equally_near_the_best_centred_is_picked():
    points = np.array([[0.01, 0, 2.0], [-0.005, 0, 2.0], [0.008, 0, 2.0]])
    assert picking.pick_cloud(points, (0, 0, 0), (0, 0, 1), 0.1) == 1


def test_every_point_of_a_cloud_is_picked_by_the_ray_through_it():
    points = np.random.default_rng(3).normal(size=(300, 3)) * 3
    eye = np.array([0.5, -9.0, 1.0])
    for index, point in enumerate(points):
        assert picking.pick_cloud(points, eye, point - eye, 1e-9) == index


def test_angles_keep_their_digits_near_the_ray():
    angles, along = picking.angles_to_ray([[1e-9, 0, 1.0], [0, 1, 0], [0, 0, -2]], (0, 0, 0), (0, 0, 3))
    np.testing.assert_allclose(angles, [1e-9, np.pi / 2, np.pi], rtol=1e-12)
    np.testing.assert_allclose(along, [1, 0, -2])


def test_a_frustum_is_picked_at_its_apex_its_middle_and_its_picture():
    centers = np.array([[0, 0, 4.0], [1.0, 0, 4.0]])
    forward = np.array([[0, 1.0, 0], [0, 1.0, 0]])
    for share in (0.0, 0.5, 1.0):
        ray = np.array([1.0, 0.2 * share, 4.0])
        assert picking.pick_frustum(centers, forward, (0, 0, 0), ray, 0.2, 0.001) == 1
    assert picking.pick_frustum(centers, forward, (0, 0, 0), (0.5, 0, 4.0), 0.2, 0.05) is None
    assert picking.pick_frustum(np.zeros((0, 3)), np.zeros((0, 3)), (0, 0, 0), (0, 0, 1), 0.2, 1.0) is None


def test_of_frusta_behind_each_other_the_nearest_is_picked():
    centers = np.array([[0, 0, 9.0], [0, 0, 3.0]])
    forward = np.array([[0, 0, 1.0], [0, 0, 1.0]])
    assert picking.pick_frustum(centers, forward, (0, 0, 0), (0, 0, 1), 0.2, 0.01) == 1


@pytest.mark.parametrize("pixel", [(0.5, 0.5), (650.0, 470.0), (1279.5, 959.5), (123.4, 900.1)])
def test_a_click_while_looking_through_a_camera_is_its_pixel(pixel):
    ray = POSE.rotation.apply(CAMERA.unproject([pixel])[0]) * 7.3
    for plane_m in (0.5, 3.0):
        found = picking.pixel_in_frame(CAMERA, POSE, POSE.translation, ray, plane_m)
        np.testing.assert_allclose(found, pixel, atol=1e-9)


def test_a_click_on_the_picture_from_elsewhere_is_its_pixel_too():
    target = POSE.apply(0.5 * np.array([(200.0 - 650) / 900, (300.0 - 470) / 905, 1.0]))
    eye = POSE.apply(np.array([0.4, -0.3, -1.0]))
    np.testing.assert_allclose(picking.pixel_in_frame(CAMERA, POSE, eye, target - eye, 0.5), [200, 300], atol=1e-9)


def test_a_click_beside_or_away_from_the_picture_is_none():
    beside = POSE.rotation.apply(CAMERA.unproject([(1281.0, 400.0)])[0])
    assert picking.pixel_in_frame(CAMERA, POSE, POSE.translation, beside, 0.5) is None
    backwards = POSE.rotation.apply(np.array([0.0, 0.0, -1.0]))
    assert picking.pixel_in_frame(CAMERA, POSE, POSE.translation, backwards, 0.5) is None
    along = POSE.rotation.apply(np.array([1.0, 0.0, 0.0]))
    assert picking.pixel_in_frame(CAMERA, POSE, POSE.translation, along, 0.5) is None


def test_a_double_click_is_one_click():
    clicks = picking.ClickFilter()
    assert clicks.is_new(10.0, (0, 0, 1))
    assert not clicks.is_new(10.1, (0, 0.001, 2))
    assert not clicks.is_new(10.2, (0, 0, 1))
    assert clicks.is_new(10.3, (0, 0.05, 1))
    assert clicks.is_new(10.9, (0, 0.05, 1))
