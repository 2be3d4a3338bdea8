"""Colours that tell ids apart, and still pictures that look into a room."""

import numpy as np
from app_project import WALLS, room_mesh, true_poses

from gazeloc_core.charts.palette import colors_of_ids
from gazeloc_core.experiments.overview import look_at, look_into, with_cameras, with_points
from gazeloc_core.scan import RoomScan


def test_neighbouring_ids_have_colours_far_apart():
    colors = colors_of_ids(np.arange(20)).astype(int)
    assert np.abs(np.diff(colors, axis=0)).max(axis=1).min() > 60
    assert (colors_of_ids(np.array([3, 3])) == colors_of_ids(np.array([3]))).all()


def test_a_camera_that_looks_at_a_point_has_it_in_its_middle():
    eye, target = np.array([1.0, 2.0, 3.0]), np.array([-1.0, 0.5, 0.2])
    pose = look_at(eye, target, np.array([0.0, 0.0, 1.0]))
    seen = (target - pose.translation) @ pose.rotation.as_matrix()
    assert np.abs(seen[:2]).max() < 1e-9
    assert seen[2] > 0
    assert (np.array([0.0, 0.0, 1.0]) @ pose.rotation.as_matrix())[1] < 0, "up is up in the picture"


def test_the_picture_looks_into_the_room_and_points_and_cameras_are_where_they_project(tmp_path):
    mesh = room_mesh()
    view = look_into(mesh, RoomScan(tmp_path, "test", mesh, up_axis="z"))
    floor = np.array([[3.3, 1.2, 0.0]])
    x, y = np.floor(view.pixels(floor)[0]).astype(int)
    assert view.rgb[y, x].tolist() == list(WALLS["floor"]), "walls and the ceiling before it are left out"
    dotted = with_points(view, floor, (255, 0, 0), 3)
    assert dotted.rgb[y, x].tolist() == [255, 0, 0]
    drawn = with_cameras(view, true_poses(4), (220, 30, 40))
    x, y = np.floor(view.pixels(np.asarray(true_poses(4).translation))[0]).astype(int)
    assert (np.abs(drawn.rgb[y - 1 : y + 2, x - 1 : x + 2].astype(int) - (220, 30, 40)).max(axis=2) < 60).any()
