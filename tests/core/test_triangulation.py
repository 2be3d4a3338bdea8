"""Triangulation against points that are known exactly, with noise, false sightings and too little to go by."""

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from gazeloc_core.camera import Camera
from gazeloc_core.errors import GeometryError
from gazeloc_core.transforms import rigid
from gazeloc_core.triangulation import Observations, triangulate, triangulate_sightings

CAMERA = Camera.pinhole(1320, 1300, 766, 766, 660, 650)


def poses_on_an_arc(count: int, width_m: float = 2.0) -> RigidTransform:
    """`world_from_camera` of cameras side by side that look at (0, 0, 3)."""
    x = np.linspace(-width_m / 2, width_m / 2, count)
    centres = np.column_stack([x, 0.2 * np.sin(3 * x), np.zeros(count)])
    return RigidTransform.from_components(centres, Rotation.from_rotvec(np.outer(-np.arctan2(x, 3), [0, 1, 0])))


def look(points: np.ndarray, poses: RigidTransform, noise_px: float, rng: np.random.Generator) -> Observations:
    """All points seen from all poses."""
    count, views = len(points), len(poses)
    pixels = [CAMERA.project(poses[k].inv().apply(points)) for k in range(views)]
    px = np.concatenate(pixels) + rng.normal(0, noise_px, (count * views, 2))
    which = np.repeat(np.arange(views), count)
    return Observations.of(np.tile(np.arange(count), views), [CAMERA] * len(px), poses[which], px)


@pytest.fixture
def points() -> np.ndarray:
    return np.random.default_rng(0).uniform([-1, -1, 2.5], [1, 1, 4], (40, 3))


def test_exact_sightings_give_exact_points(points: np.ndarray) -> None:
    answer = triangulate(look(points, poses_on_an_arc(5), 0, np.random.default_rng(1)), len(points))
    np.testing.assert_allclose(answer.points, points, atol=1e-7)
    assert answer.is_reliable.all()
    assert (answer.views == 5).all()
    assert (answer.parallax_deg > 20).all()


def test_noise_is_spread_as_the_covariance_says(points: np.ndarray) -> None:
    rng = np.random.default_rng(2)
    errors, covariances = [], []
    for _ in range(40):
        answer = triangulate(look(points, poses_on_an_arc(8), 0.5, rng), len(points))
        errors.append(answer.points - points)
        covariances.append(answer.covariance)
    e, c = np.concatenate(errors), np.concatenate(covariances)
    # rms_px has two coordinates in it, so that the covariance is that of a sigma larger by about sqrt(2).
    mahalanobis = np.einsum("ni,nij,nj->n", e, np.linalg.inv(c), e)
    assert 1.0 < mahalanobis.mean() < 2.5
    assert np.abs(e.mean(axis=0)).max() < 3 * e.std() / np.sqrt(len(e))


def test_false_sightings_are_dropped(points: np.ndarray) -> None:
    rng = np.random.default_rng(3)
    seen = look(points, poses_on_an_arc(10), 0.3, rng)
    false = rng.random(len(seen)) < 0.2
    normalised = seen.normalised + np.where(false[:, None], rng.uniform(0.05, 0.3, (len(seen), 2)), 0)
    answer = triangulate(Observations(seen.point, seen.camera_from_world, normalised, seen.focal_px), len(points))
    assert np.linalg.norm(answer.points - points, axis=1).max() < 0.02
    assert not answer.is_used[false].any()
    assert answer.is_used[~false].mean() > 0.99


def test_what_is_not_determined_is_nan() -> None:
    poses = poses_on_an_arc(2)
    lonely = Observations.of([0], [CAMERA], poses[[0]], [[600.0, 600.0]])
    same_place = Observations.of([1, 1], [CAMERA] * 2, poses[[0, 0]], [[600.0, 600.0]] * 2)
    both = Observations(*(np.concatenate([getattr(a, n) for a in (lonely, same_place)]) for n in vars(lonely)))
    answer = triangulate(both, 3)
    assert np.isnan(answer.points).all()
    assert np.isnan(answer.rms_px).all()
    assert not answer.is_reliable.any()
    assert answer.views.tolist() == [0, 0, 0]


def test_rays_that_meet_behind_the_cameras_give_nothing() -> None:
    poses = RigidTransform.from_components(np.array([[-0.5, 0, 0], [0.5, 0, 0]]), Rotation.identity(2))
    outward = [[500.0, 650.0], [820.0, 650.0]]  # the left camera looks left, the right one right
    answer = triangulate(Observations.of([0, 0], [CAMERA] * 2, poses, outward), 1)
    assert np.isnan(answer.points).all()
    with pytest.raises(GeometryError, match="behind a camera"):
        triangulate_sightings([CAMERA] * 2, poses, outward)


def test_clicks_give_a_point_and_its_evidence() -> None:
    target, poses = np.array([0.2, -0.3, 3.1]), poses_on_an_arc(3)
    px = np.array([CAMERA.project(poses[k].inv().apply(target))[0] for k in range(3)])
    exact = triangulate_sightings([CAMERA] * 3, poses, px)
    np.testing.assert_allclose(exact.point, target, atol=1e-7)
    assert exact.is_reliable
    assert exact.rms_px < 1e-3
    wrong = triangulate_sightings([CAMERA] * 3, poses, px + np.array([[0, 0], [0, 40], [0, 0]]))
    assert not wrong.is_reliable
    assert wrong.rms_px > 10


def test_clicks_that_do_not_determine_a_point_are_refused_in_words() -> None:
    poses = poses_on_an_arc(2, width_m=0.02)
    with pytest.raises(GeometryError, match="at least two frames, got 1"):
        triangulate_sightings([CAMERA], poses[[0]], [[10.0, 10.0]])
    px = [CAMERA.project(poses[k].inv().apply(np.array([0, 0, 3.0])))[0] for k in range(2)]
    with pytest.raises(GeometryError, match=r"0\.\d\d° apart"):
        triangulate_sightings([CAMERA] * 2, poses, px)


def test_no_points_are_no_error() -> None:
    empty = Observations(np.empty(0, np.int64), np.empty((0, 3, 4)), np.empty((0, 2)), np.empty(0))
    assert triangulate(empty, 0).points.shape == (0, 3)


def test_the_error_of_a_point_from_clicks_is_predicted():
    """Over many draws of noisy clicks the points scatter as `sigma` says, near and far."""
    rng = np.random.default_rng(3)
    camera = Camera.pinhole(1000, 800, 900, 900, 500, 400)
    poses = rigid(Rotation.identity(3), [[-0.4, 0, 0], [0, 0.1, 0], [0.4, 0, 0]])
    for depth in (1.5, 6.0):
        place = np.array([0.1, -0.2, depth])
        pixels = camera.project(place - np.asarray(poses.translation))
        found = [triangulate_sightings([camera] * 3, poses, pixels + rng.normal(0, 1.5, (3, 2))) for _ in range(300)]
        scatter = np.sqrt(np.mean([(point.point - place) ** 2 for point in found]))
        assert 0.7 < np.median([point.sigma for point in found]) / scatter < 1.4
