"""Undistortion against the rational model written out by hand, and against pictures whose values are known."""

import numpy as np
import pytest

from gazeloc_core.camera import Camera
from gazeloc_core.errors import InputError
from gazeloc_core.frames.undistort import (
    Coverage,
    Undistorter,
    UndistortOptions,
    undistorted_camera,
    unproject_checked,
    valid_radius,
)

K = np.array([[766.3, 0, 543.7], [0, 766.4, 541.5], [0, 0, 1]])
RATIONAL = np.array([-0.1258, 0.1006, 4.5e-4, -4.6e-4, 0.0242, 0.2028, 0.0077, 0.0630])


@pytest.fixture(scope="module")
def lens() -> Camera:
    return Camera.from_opencv(1088, 1080, K, RATIONAL)


@pytest.fixture(scope="module")
def undistorter(lens: Camera) -> Undistorter:
    return Undistorter.of(lens)


def distort_by_hand(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """OpenCV's documented formula, plus the half pixel of our convention."""
    k1, k2, p1, p2, k3, k4, k5, k6 = RATIONAL
    r2 = x**2 + y**2
    radial = (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) / (1 + k4 * r2 + k5 * r2**2 + k6 * r2**3)
    u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x**2)
    v = y * radial + p1 * (r2 + 2 * y**2) + 2 * p2 * x * y
    return np.column_stack([K[0, 0] * u + K[0, 2] + 0.5, K[1, 1] * v + K[1, 2] + 0.5])


def test_pixels_follow_the_rational_model(lens: Camera, undistorter: Undistorter) -> None:
    target = undistorter.target
    pixels = np.random.default_rng(0).uniform(0, [target.width, target.height], (500, 2))
    x, y = ((pixels - target.principal_point_px) / target.focal_px).T
    np.testing.assert_allclose(undistorter.pixels_to_distorted(pixels), distort_by_hand(x, y), atol=1e-6)


def test_pixels_come_back(lens: Camera, undistorter: Undistorter) -> None:
    pixels = np.random.default_rng(1).uniform(0, [lens.width, lens.height], (500, 2))
    back = undistorter.pixels_to_distorted(undistorter.pixels_to_undistorted(pixels))
    np.testing.assert_allclose(back, pixels, atol=0.01)


@pytest.mark.parametrize("axis", [0, 1])
def test_pictures_move_by_the_same_map_as_pixels(lens: Camera, undistorter: Undistorter, axis: int) -> None:
    # A picture whose value at pixel centre c is a ramp of c: any half-pixel slip shows as a constant offset.
    scale = 0.2
    centres = lens.pixel_centres()[:, axis].reshape(lens.height, lens.width)
    picture = np.repeat(np.rint(centres * scale).astype(np.uint8)[..., None], 3, axis=2)
    out = undistorter.image(picture)[..., 0].astype(float)
    places = undistorter.pixels_to_distorted(undistorter.target.pixel_centres())
    inside = ((places > 2) & (places < [lens.width - 2, lens.height - 2])).all(axis=1).reshape(out.shape)
    error = (out / scale - places[:, axis].reshape(out.shape))[inside]
    assert abs(error.mean()) < 0.05
    assert np.abs(error).max() < 1 / scale


def test_resolution_of_the_centre_is_kept(lens: Camera, undistorter: Undistorter) -> None:
    a, b = undistorter.pixels_to_undistorted([[543.7, 541.5], [544.7, 541.5]])
    assert np.linalg.norm(b - a) == pytest.approx(1, abs=0.01)


def test_coverage_grows(lens: Camera) -> None:
    widths = [undistorted_camera(lens, UndistortOptions(coverage=c)).width for c in Coverage]
    assert lens.width < widths[0] <= widths[1] < widths[2]


def test_inside_has_no_black_and_whole_keeps_every_corner(lens: Camera) -> None:
    white = np.full((lens.height, lens.width, 3), 255, np.uint8)
    inside = Undistorter.of(lens, UndistortOptions(coverage=Coverage.INSIDE)).image(white)
    assert inside[2:-2, 2:-2].min() > 250
    whole = undistorted_camera(lens, UndistortOptions(coverage=Coverage.WHOLE))
    corners = Undistorter(lens, whole).pixels_to_undistorted([[0, 0], [1088, 0], [0, 1080], [1088, 1080]])
    assert whole.contains(np.clip(corners, 0, [whole.width, whole.height])).all()
    assert (corners > -1).all()
    assert (corners < [whole.width + 1, whole.height + 1]).all()


def test_a_lens_that_folds_back_shows_black_instead_of_ghosts() -> None:
    # With k1 = -0.3 alone, r(1 - 0.3 r²) turns back at r = sqrt(1 / 0.9).
    folding = Camera.from_opencv(400, 400, [[200, 0, 199.5], [0, 200, 199.5], [0, 0, 1]], [-0.3, 0, 0, 0])
    turn = np.sqrt(1 / 0.9)
    assert valid_radius(folding) == pytest.approx(turn, abs=0.02)
    target = Camera.pinhole(1000, 1000, 200, 200, 500, 500)
    undistorter = Undistorter(folding, target)
    picture = np.full((400, 400, 3), 200, np.uint8)
    shown = undistorter.image(picture)[..., 0]
    radius = np.linalg.norm(target.pixel_centres() - 500, axis=1).reshape(1000, 1000) / 200
    assert shown[radius < turn * 0.95].min() == 200
    assert shown[radius > turn * 1.05].max() == 0
    assert np.isnan(undistorter.pixels_to_distorted([[990.0, 990.0]])).all()


def test_pixels_that_no_ray_reaches_are_nan() -> None:
    folding = Camera.from_opencv(400, 400, [[100, 0, 199.5], [0, 100, 199.5], [0, 0, 1]], [-0.3, 0, 0, 0])
    rays = unproject_checked(folding, [[200.0, 200.0], [1.0, 1.0], [np.nan, 3.0]])
    assert np.isfinite(rays[0]).all()
    assert np.isnan(rays[1:]).all()
    with pytest.raises(InputError, match="does not cover"):
        undistorted_camera(folding)


def test_a_pinhole_passes_through() -> None:
    camera = Camera.pinhole(64, 48, 60, 60, 32, 24)
    assert undistorted_camera(camera) is camera
    picture = np.random.default_rng(2).integers(0, 255, (48, 64, 3), dtype=np.uint8)
    undistorter = Undistorter.of(camera)
    assert undistorter.image(picture) is picture
    np.testing.assert_allclose(undistorter.pixels_to_distorted([[3.2, 4.5]]), [[3.2, 4.5]])


def test_a_picture_of_another_size_is_refused(undistorter: Undistorter) -> None:
    with pytest.raises(InputError, match="640x480"):
        undistorter.image(np.zeros((480, 640, 3), np.uint8))
