"""The paper's measures of a tag pose solver, on corners whose poses are known exactly."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import RigidTransform, Rotation

from gazeloc_core.camera import Camera
from gazeloc_core.errors import InputError
from gazeloc_core.tag_quality.analysis import AnalysisOptions, analyse_solver, tag_place_errors, viewing_angles_deg
from gazeloc_core.tag_types import TagCorners, TagSightings
from gazeloc_core.tags.pose import apriltag_poses, tag_poses
from gazeloc_core.tags.square import UNIT_SQUARE

SIZE_M = 0.16
SQUARE = np.column_stack([UNIT_SQUARE, np.zeros(4)]) * SIZE_M
UNEVEN = Camera.pinhole(1000, 800, 700, 760, 480, 410)
BENT = Camera.from_opencv(
    1088,
    1080,
    [[766, 0, 543], [0, 766, 541], [0, 0, 1]],
    [-0.1257, 0.1009, 0.0004, -0.0005, 0.0077, 0.2101, 0.009, 0.0152],
)


def poses(count: int, seed: int = 0) -> RigidTransform:
    """Tags turned by up to 60°, 0.7 to 3 m away, anywhere in the picture."""
    rng = np.random.default_rng(seed)
    z = rng.uniform(0.7, 3, count)
    side = rng.uniform(-0.4, 0.4, (count, 2)) * z[:, None]
    tilt = Rotation.from_rotvec(
        np.radians(rng.uniform(15, 60, count))[:, None] * _unit(np.column_stack([rng.normal(size=(count, 2)), 0 * z]))
    )
    roll = Rotation.from_rotvec(np.outer(rng.uniform(-1, 1, count), [0, 0, 1]))
    return RigidTransform.from_components(np.column_stack([side, z]), tilt * roll)


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def sightings(camera: Camera, camera_from_tag: RigidTransform, noise_px: float = 0.0, tag_id: int = 3) -> TagSightings:
    rng = np.random.default_rng(1)
    count = len(camera_from_tag)
    corners = np.array([camera.project(pose.apply(SQUARE)) for pose in camera_from_tag])
    corners += rng.normal(0, 1, corners.shape) * noise_px
    return TagSightings(np.arange(count), np.full(count, tag_id), corners, np.full(count, 50.0))


@pytest.mark.parametrize("camera", [UNEVEN, BENT], ids=["uneven focal lengths", "bent lens"])
@pytest.mark.parametrize("solver", [tag_poses, apriltag_poses])
def test_exact_corners_have_the_paper_s_alpha_exactly(camera: Camera, solver) -> None:
    """Slope, every corner's alpha and the true ratio of distance and size are one number; figure 3 is a line."""
    true = poses(30)
    found = analyse_solver(sightings(camera, true), camera, SIZE_M, AnalysisOptions(solver=solver))
    distance = np.linalg.norm(true.translation, axis=1)
    tolerance = 1e-6 if solver is tag_poses else 2e-3  # the other one iterates and stops early
    np.testing.assert_allclose(found.distance_m, distance, rtol=tolerance)
    np.testing.assert_allclose(found.alpha_estimated, distance / SIZE_M, rtol=tolerance)
    np.testing.assert_allclose(found.alpha_of_corner, np.tile(distance / SIZE_M, (4, 1)).T, rtol=tolerance)
    assert found.distance_error_m.max() < tolerance * 3
    assert np.abs(found.intercept_m).max() < tolerance
    assert found.line_residual_m.max() < tolerance


def test_the_drawing_of_figure_4_in_numbers() -> None:
    """Equations (1) to (3) by hand for a tag straight ahead: f = 500, distance 2, half a diagonal of 0.1·√2."""
    camera = Camera.pinhole(400, 400, 500, 500, 200, 200)
    corners = 200 + UNIT_SQUARE * 0.2 * 500 / 2
    found = analyse_solver(TagSightings([0], [0], corners[None], [9.0]), camera, 0.2)
    np.testing.assert_allclose(found.alpha_of_corner, 500 / (25 * np.sqrt(2)) * (0.1 * np.sqrt(2) / 0.2), rtol=1e-6)
    np.testing.assert_allclose(found.alpha_estimated, 2 / 0.2, rtol=1e-6)


@given(scale=st.floats(0.2, 5.0))
def test_what_is_told_to_be_larger_is_further_away_by_as_much(scale: float) -> None:
    seen = sightings(UNEVEN, poses(4), noise_px=0.3)
    one = analyse_solver(seen, UNEVEN, SIZE_M, AnalysisOptions(solver=tag_poses))
    other = analyse_solver(seen, UNEVEN, SIZE_M * scale, AnalysisOptions(solver=tag_poses))
    np.testing.assert_allclose(other.distance_m, scale * one.distance_m, rtol=1e-6)
    np.testing.assert_allclose(other.alpha_true, one.alpha_true, rtol=1e-6)
    np.testing.assert_allclose(other.distance_error_m, scale * one.distance_error_m, rtol=1e-3, atol=1e-9)


def test_noise_in_the_corners_shows_in_the_error_and_grows_with_it() -> None:
    true = poses(200)
    medians = [
        np.median(analyse_solver(sightings(UNEVEN, true, noise), UNEVEN, SIZE_M).distance_error_m)
        for noise in (0.1, 0.4, 1.6)
    ]
    assert medians[0] < medians[1] / 2 < medians[2] / 4
    assert medians[0] > 1e-5


def test_a_wrong_focal_length_is_a_true_error_that_the_paper_s_measure_cannot_see() -> None:
    """Why the measure needs the third paragraph of section V beside it."""
    true = RigidTransform.from_components([[0.0, 0, 2.0]], Rotation.from_euler("xyz", [[20, 5, 3]], degrees=True))
    seen = sightings(UNEVEN, true)
    zoomed = Camera.pinhole(1000, 800, 1.1 * 700, 1.1 * 760, 480, 410)
    found = analyse_solver(seen, zoomed, SIZE_M, AnalysisOptions(solver=tag_poses))
    assert abs(found.distance_m[0] - 2.0) > 0.18
    assert found.distance_error_m[0] < 0.01


def test_viewing_angles_are_named_by_the_camera_s_axes() -> None:
    turns = Rotation.from_euler("xyz", [[0, 0, 0], [30, 0, 0], [0, -40, 0], [0, 0, 50]], degrees=True)
    euler, oblique = viewing_angles_deg(turns.as_matrix(), np.tile([0.0, 0, 2], (4, 1)))
    np.testing.assert_allclose(euler, [[0, 0, 0], [30, 0, 0], [0, -40, 0], [0, 0, 50]], atol=1e-9)
    np.testing.assert_allclose(oblique, [0, 30, 40, 0], atol=1e-6)
    _, aside = viewing_angles_deg(np.eye(3)[None], np.array([[2.0, 0, 2.0]]))  # parallel to the picture, at its edge
    np.testing.assert_allclose(aside, [45])


def test_a_sighting_without_a_pose_is_nan_and_the_others_stay() -> None:
    seen = sightings(UNEVEN, poses(3))
    corners = np.array(seen.corners_px)
    corners[1] = np.nan
    found = analyse_solver(replace(seen, corners_px=corners), UNEVEN, SIZE_M)
    assert np.isnan(found.distance_error_m).tolist() == [False, True, False]
    assert np.isnan(found.euler_deg[1]).all()


def test_no_sightings_are_no_rows() -> None:
    none = TagSightings(*(np.empty(shape) for shape in ((0,), (0,), (0, 4, 2), (0,))))
    found = analyse_solver(none, UNEVEN, SIZE_M)
    assert found.distance_of_size_m.shape == (0, 7)
    assert found.euler_deg.shape == (0, 3)


def test_tags_are_put_back_on_the_scan_where_they_are() -> None:
    """Known camera poses, one tag in the scan, seen from many places: no error; and the errors of a moved place."""
    rng = np.random.default_rng(3)
    camera_from_tag = poses(20)
    scan_from_tag = RigidTransform.from_components([1.0, 2.0, 3.0], Rotation.from_rotvec([0.3, -0.5, 0.2]))
    scan_from_camera = scan_from_tag * camera_from_tag.inv()
    place = scan_from_tag.apply(SQUARE)
    seen = sightings(UNEVEN, camera_from_tag)
    exact = tag_place_errors(seen, UNEVEN, scan_from_camera, TagCorners([3], place[None], [20], [0.0]), SIZE_M)
    assert exact.error_m.max() < 2e-3
    assert exact.rotation_error_deg.max() < 0.5
    np.testing.assert_allclose(exact.distance_m, np.linalg.norm(camera_from_tag.translation, axis=1))
    shift = rng.normal(size=3)
    moved = TagCorners([3], place[None] + 0.1 * shift / np.linalg.norm(shift), [20], [0.0])
    off = tag_place_errors(seen, UNEVEN, scan_from_camera, moved, SIZE_M)
    np.testing.assert_allclose(off.error_m, 0.1, atol=2e-3)
    assert np.abs(off.range_error_m).max() <= 0.1 + 2e-3


def test_a_tag_without_a_place_has_no_error() -> None:
    true = poses(2)
    unit = RigidTransform.concatenate([RigidTransform.identity()] * 2)
    elsewhere = TagCorners([8], SQUARE[None], [1], [0.0])
    found = tag_place_errors(sightings(UNEVEN, true), UNEVEN, unit, elsewhere, SIZE_M)
    assert np.isnan(found.error_m).all()
    assert np.isfinite(found.centre_in_scan).all()


def test_impossible_inputs_are_refused() -> None:
    seen = sightings(UNEVEN, poses(2))
    with pytest.raises(InputError, match="no line"):
        analyse_solver(seen, UNEVEN, SIZE_M, AnalysisOptions(steps=1))
    with pytest.raises(InputError, match="tag size"):
        analyse_solver(seen, UNEVEN, -1.0)
    with pytest.raises(InputError, match="1 cameras"):
        analyse_solver(seen, [UNEVEN], SIZE_M)
    with pytest.raises(InputError, match="give scan_from_camera"):
        tag_place_errors(seen, UNEVEN, poses(3), TagCorners([3], SQUARE[None], [1], [0.0]), SIZE_M)
