"""A keypoint in another camera: its pixel, and the line on which one click leaves it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from gazeloc_core.camera import Camera
from gazeloc_core.clicks.keypoint_views import View, line_of_click

PINHOLE = Camera.pinhole(800, 600, 700, 710, 390, 310)
FISHY = Camera("OPENCV", 800, 600, np.array([700, 700, 400, 300, -0.2, 0.05, 0.001, -0.001]))


def view(camera, x=0.0, turn_deg=0.0):
    return View(camera, RigidTransform.from_components((x, 0, 0), Rotation.from_euler("y", turn_deg, degrees=True)))


@pytest.mark.parametrize("camera", [PINHOLE, FISHY])
def test_every_place_on_the_ray_of_a_click_is_on_its_line(camera):
    one, other = view(camera), view(camera, 1.0, -15)
    place = np.array([0.2, -0.1, 3.0])
    pixel = one.pixel_of(place)
    line = line_of_click(one, *pixel, other)
    for depth in (0.8, 1.0, 1.5):
        expected = other.pixel_of(place * depth)
        gaps = np.linalg.norm(np.diff(line, axis=0), axis=1).max()
        assert np.linalg.norm(line - expected, axis=1).min() < gaps
        nearest = np.argsort(np.linalg.norm(line - expected, axis=1))[:2]
        a, b = line[nearest]
        across = abs(np.linalg.det([b - a, expected - a])) / np.linalg.norm(b - a)
        assert across < (1e-6 if camera.is_pinhole else 0.1)


def test_a_pixels_ray_goes_through_what_is_seen_there():
    here = view(FISHY, 0.5, 30)
    place = here.scan_from_camera.apply(np.array([0.3, 0.2, 2.0]))
    origin, direction = here.ray_of(*here.pixel_of(place))
    assert np.linalg.norm(np.cross(place - origin, direction)) < 1e-6


def test_what_is_behind_or_beside_has_no_pixel_and_no_line():
    assert view(PINHOLE).pixel_of((0, 0, -1)) is None
    assert view(PINHOLE).pixel_of((9, 0, 1)) is None
    assert line_of_click(view(PINHOLE), 400, 300, view(PINHOLE, 0.0, 180)).shape == (0, 2)
