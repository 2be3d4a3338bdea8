"""Method `global`: shapes alone give the similarity, on made-up rooms and on a real pair of clouds."""

from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from data import SHARED, needs_shared
from scipy.spatial.transform import Rotation

from gazeloc_core.errors import Cancelled, GeometryError, InputError
from gazeloc_core.localize.global_ import GlobalOptions, align_global, register_global
from gazeloc_core.scan import Mesh
from gazeloc_core.surfaces.clouds import _registered, icp_point_to_point, sample_surface
from gazeloc_core.transforms import Similarity, rotation_angle_rad

SFM_FROM_SCAN = Similarity(0.37, Rotation.from_rotvec([0.5, -1.1, 0.3]), np.array([1.0, -2.0, 0.5]))
SCALE = 1 / 0.37
QUICK = GlobalOptions(samples=8000, ransac_iterations=200_000)


def clutter(seed: int = 0) -> Mesh:
    """Boxes of all sizes and directions on a floor: a shape that is like itself in no other pose."""
    rng = np.random.default_rng(seed)
    parts = [trimesh.creation.box((4.0, 0.05, 3.0))]
    for _ in range(14):
        place = np.eye(4)
        place[:3, :3] = Rotation.from_rotvec([0, rng.uniform(0, 3), 0.3 * rng.normal()]).as_matrix()
        place[:3, 3] = rng.uniform((-1.7, 0, -1.2), (1.7, 1.0, 1.2))
        parts.append(trimesh.creation.box(rng.uniform(0.1, 0.8, 3), place))
    whole = trimesh.util.concatenate(parts)
    return Mesh(whole.vertices, whole.faces)


@pytest.fixture(scope="module")
def surfaces():
    scan = clutter()
    return Mesh(SFM_FROM_SCAN.apply(scan.vertices), scan.faces), scan


@pytest.fixture(scope="module")
def registered(surfaces):
    return align_global(*surfaces, QUICK)


def off_by(found: Similarity, points_in_scan) -> float:
    """The largest distance in metres between points and where `found` puts them."""
    return float(np.linalg.norm(found.apply(SFM_FROM_SCAN.apply(points_in_scan)) - points_in_scan, axis=1).max())


def test_it_finds_the_truth_from_shapes_alone(surfaces, registered):
    assert registered.scan_from_sfm.scale == pytest.approx(SCALE, rel=0.005)
    assert off_by(registered.scan_from_sfm, surfaces[1].vertices) < 0.02


def test_the_papers_answer_keeps_the_scale_that_ransac_found(registered):
    ransac, icp, refined = (registered.step(name) for name in ("ransac", "icp", "icp with scale"))
    assert icp.scan_from_sfm.scale == pytest.approx(ransac.scan_from_sfm.scale, rel=1e-9)
    assert abs(refined.scan_from_sfm.scale / SCALE - 1) < abs(icp.scan_from_sfm.scale / SCALE - 1)


def test_without_refinement_the_answer_is_the_papers(surfaces, registered):
    plain = align_global(*surfaces, GlobalOptions(samples=8000, ransac_iterations=200_000, refine_scale=False))
    assert [step.name for step in plain.steps] == ["normalised", "ransac", "icp"]
    np.testing.assert_array_equal(plain.scan_from_sfm.as_matrix(), registered.step("icp").scan_from_sfm.as_matrix())


def test_a_given_scale_is_never_touched(surfaces):
    found = align_global(*surfaces, QUICK, scale=SCALE)
    assert [step.name for step in found.steps] == ["normalised", "ransac", "icp"]
    for step in found.steps:
        assert step.scan_from_sfm.scale == pytest.approx(SCALE, rel=1e-6)
    assert off_by(found.scan_from_sfm, surfaces[1].vertices) < 0.02


def test_both_clouds_are_normalised_to_one(registered):
    """Section VI-A, step 2: each box is centred and its longest side becomes [-1, 1]."""
    for to_normalised, points in (
        (registered.normalised_from_sfm, registered.sfm_points),
        (registered.normalised_from_scan, registered.scan_points),
    ):
        normalised = to_normalised.apply(points)
        low, high = normalised.min(axis=0), normalised.max(axis=0)
        assert (high - low).max() == pytest.approx(2)
        np.testing.assert_allclose(low + high, 0, atol=1e-9)
    first = registered.step("normalised").scan_from_sfm
    expected = registered.normalised_from_scan.inverse() * registered.normalised_from_sfm
    np.testing.assert_allclose(first.as_matrix(), expected.as_matrix())


def test_the_same_seed_gives_the_same_answer_to_the_last_bit(surfaces, registered):
    again = align_global(*surfaces, QUICK)
    other = align_global(*surfaces, GlobalOptions(samples=8000, ransac_iterations=200_000, seed=1))
    np.testing.assert_array_equal(again.scan_from_sfm.as_matrix(), registered.scan_from_sfm.as_matrix())
    assert (other.sfm_points != registered.sfm_points).any()


def test_a_wrong_answer_is_not_dressed_up():
    """Two rooms that are not the same: there is an answer, with a fitness that says how little fits."""
    right, wrong = (align_global(clutter(), clutter(seed), QUICK, scale=1.0) for seed in (0, 9))
    assert right.steps[-1].fitness > 0.9
    assert wrong.steps[-1].fitness < 0.7


CAR = SHARED / "registration_pairs" / "car_cloud_similarity.npz"


def halves(seed: int):
    """Different halves of a real lidar cloud and of its copy scaled by 1.04, in orders that have nothing in common."""
    clouds, rng = np.load(CAR), np.random.default_rng(seed)
    sides = (clouds["cloud400"], clouds["cloud400_scaled"])
    return [side[rng.permutation(len(side))[: len(side) // 2]] for side in sides]


@needs_shared
@pytest.mark.parametrize("seed", range(3))
def test_the_real_pair_without_any_common_order(seed):
    found = register_global(*halves(seed)).scan_from_sfm
    assert found.scale == pytest.approx(1.04, abs=0.002)
    assert np.rad2deg(rotation_angle_rad(found.rotation, Rotation.from_rotvec([0, 0, 0.2]))) < 0.2
    np.testing.assert_allclose(found.translation, 2.0, atol=0.03)  # in a cloud of 130 m


@needs_shared
def test_the_real_pair_the_other_way_round():
    first, second = halves(0)
    found = register_global(second, first).scan_from_sfm
    assert found.scale == pytest.approx(1 / 1.04, abs=0.002)


@needs_shared
def test_the_papers_steps_alone_miss_the_real_pairs_scale():
    """Why `refine_scale` is on: RANSAC's scale is as coarse as its voxels, and ICP without scale keeps it."""
    found = register_global(*halves(0), GlobalOptions(refine_scale=False)).scan_from_sfm
    assert 0.002 < abs(found.scale - 1.04) < 0.1


GOOD = np.random.default_rng(0).uniform(-1, 1, (500, 3))


@pytest.mark.parametrize(
    ("sfm", "scan", "sentence"),
    [
        (GOOD[:, :2], GOOD, r"reconstruction has the shape \(500, 2\)"),
        (GOOD, GOOD[:3], r"scan has the shape \(3, 3\)"),
        (GOOD, GOOD[0], r"scan has the shape \(3,\)"),
        (np.where(GOOD > 0.99, np.nan, GOOD), GOOD, "points that are not finite"),
        (GOOD, np.ones((500, 3)), "all at one place"),
    ],
)
def test_clouds_that_are_none_are_refused(sfm, scan, sentence):
    with pytest.raises(InputError, match=sentence):
        register_global(sfm, scan, QUICK)


@pytest.mark.parametrize("scale", [0.0, -1.0, np.nan, np.inf])
def test_a_scale_that_cannot_be_is_refused(scale):
    with pytest.raises(InputError, match="metres per unit"):
        register_global(GOOD, GOOD, QUICK, scale=scale)


def test_shapes_that_nothing_joins_are_a_sentence():
    with pytest.raises(GeometryError, match="No part of the reconstruction has the shape"):
        register_global(GOOD[:4] * 100, GOOD, GlobalOptions(voxel=3.0))


def test_a_surface_without_area_is_a_sentence(surfaces):
    needle = Mesh(np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]), np.array([[0, 1, 2]]))
    with pytest.raises(GeometryError, match="no area"):
        align_global(needle, surfaces[1], QUICK)


@pytest.mark.parametrize(
    "field",
    [{"samples": 0}, {"voxel": 0.0}, {"icp_distance": -1.0}, {"scale_distances": (0.1, 0.0)}, {"seed": -1}],
    ids=lambda field: next(iter(field)),
)
def test_options_that_cannot_be_are_refused(field):
    with pytest.raises(InputError, match="above 0"):
        GlobalOptions(**field)


def test_it_can_be_cancelled(surfaces):
    def report(fraction, text=""):
        if fraction >= 0.2:
            raise Cancelled("stopped")

    with pytest.raises(Cancelled):
        align_global(*surfaces, QUICK, report=report)


def test_samples_lie_on_the_surface_and_are_spread_by_area():
    big_and_small = Mesh(
        np.array([[0.0, 0, 0], [3, 0, 0], [0, 3, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1]]), np.array([[0, 1, 2], [3, 4, 5]])
    )
    points = sample_surface(big_and_small, 10_000, 3)
    on_big = np.abs(points[:, 2]) < 1e-12
    assert np.isclose(points[~on_big, 2], 1).all()
    assert on_big.mean() == pytest.approx(0.9, abs=0.015)
    assert (points[on_big, :2].sum(axis=1) <= 3 + 1e-9).all()


def test_icp_leaves_out_what_is_too_far_and_says_how_much():
    rng = np.random.default_rng(1)
    target = rng.uniform(-1, 1, (2000, 3))
    source = target[:1000] + np.array([0.01, 0, 0])
    source[:250] += 50.0
    found = icp_point_to_point(source, target, Similarity.identity(), within=0.03)
    assert found.fitness == pytest.approx(0.75)
    np.testing.assert_allclose(found.a_from_b.translation, (-0.01, 0, 0), atol=1e-6)
    assert icp_point_to_point(source + 100, target, Similarity.identity(), within=0.03) is None


@pytest.mark.parametrize("scale", [0.0, 0.005, -1.0])
def test_a_cloud_that_collapsed_onto_a_point_or_was_mirrored_is_no_answer(scale):
    matrix = np.diag([scale, scale, scale, 1.0])
    assert _registered(SimpleNamespace(fitness=0.9, inlier_rmse=0.001, transformation=matrix)) is None
