"""ATE, RPE, outliers and percentiles: against evo on TUM files of ours, and by what must hold of them."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from box_room import camera_poses
from evo.core import metrics, sync
from evo.tools import file_interface
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import RigidTransform, Rotation

from gazeloc_core.errors import GeometryError
from gazeloc_core.evaluation.evaluate import Evaluation, evaluate
from gazeloc_core.evaluation.trajectory_errors import (
    AbsoluteError,
    ErrorSummary,
    Outliers,
    RelativeError,
    aligned_centers,
    pairs_apart,
    pairs_in_order,
    percentile,
    relative_pose_errors,
)
from gazeloc_core.evaluation.truth import read_tum
from gazeloc_core.export.tum import write_tum
from gazeloc_core.trajectory import PoseStatus, Trajectory
from gazeloc_core.transforms import Similarity, wxyz_of

COUNT, SPACING_NS = 60, 100_000_000
TIMES = 1_700_000_000_000_000_000 + SPACING_NS * np.arange(COUNT)
SIX_DIGITS = 1e-6


def trajectory_of(poses: RigidTransform) -> Trajectory:
    status = np.full(len(poses), PoseStatus.REGISTERED.value)
    return Trajectory(TIMES, status, np.ones(COUNT, bool), poses.translation, wxyz_of(poses.rotation))


def disturbed(poses: RigidTransform, seed: int = 0) -> RigidTransform:
    """Poses with noise, in a scan that is scaled by 3 %, turned and shifted."""
    rng = np.random.default_rng(seed)
    noisy = RigidTransform.from_components(
        poses.translation + rng.normal(0, 0.03, (len(poses), 3)),
        Rotation.from_rotvec(rng.normal(0, 0.02, (len(poses), 3))) * poses.rotation,
    )
    return Similarity(1.03, Rotation.from_rotvec([0.02, -0.05, 0.01]), np.array([0.2, 0.0, -0.1])).compose_pose(noisy)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The estimate and the truth as TUM files that `gazeloc export` would write."""
    folder = tmp_path_factory.mktemp("tum")
    truth = camera_poses(COUNT)
    write_tum(trajectory_of(disturbed(truth)), folder / "estimate.tum")
    write_tum(trajectory_of(truth), folder / "truth.tum")
    return folder / "estimate.tum", folder / "truth.tum"


@pytest.fixture(scope="module")
def ours(files: tuple[Path, Path]) -> Evaluation:
    """Our evaluation of the same two files."""
    return evaluate(trajectory_of(read_tum(files[0])[1]), *read_tum(files[1]))


def evo_pair(files: tuple[Path, Path], align: str | None = None) -> tuple[Any, Any]:
    estimate, truth = (file_interface.read_tum_trajectory_file(path) for path in files)
    truth, estimate = sync.associate_trajectories(truth, estimate)
    if align is not None:
        estimate.align(truth, correct_scale=align == "sim3")
    return truth, estimate


def evo_statistics(metric: Any, pair: tuple[Any, Any]) -> dict[str, float]:
    metric.process_data(pair)
    return metric.get_all_statistics()


@pytest.mark.parametrize(
    ("name", "relation"),
    [
        ("position_m", metrics.PoseRelation.translation_part),
        ("rotation_deg", metrics.PoseRelation.rotation_angle_deg),
    ],
)
def test_headline_errors_equal_evos(files, ours, name, relation):
    found = getattr(ours, name)
    evos = evo_statistics(metrics.APE(relation), evo_pair(files))
    for statistic in ("mean", "median", "max"):
        assert getattr(found, statistic) == pytest.approx(evos[statistic], abs=SIX_DIGITS)
    assert found.mean > 0.01


@pytest.mark.parametrize("align", [None, "se3", "sim3"])
def test_ate_equals_evos(files, ours, align):
    evos = evo_statistics(metrics.APE(metrics.PoseRelation.translation_part), evo_pair(files, align))["rmse"]
    assert getattr(ours.ate_m, "unaligned" if align is None else f"{align}_aligned") == pytest.approx(
        evos, abs=SIX_DIGITS
    )
    assert evos > 0.02


@pytest.mark.parametrize(("name", "step"), [("rpe_in_order", 1), ("rpe_per_second", 10)])
def test_rpe_equals_evos(files, ours, name, step):
    """At 10 poses a second, those ten rows on are those a second later."""
    found: RelativeError = getattr(ours, name)
    pair = evo_pair(files)
    for relation, key in (("translation_part", "position_{}_m"), ("rotation_angle_deg", "rotation_{}_deg")):
        metric = metrics.RPE(metrics.PoseRelation[relation], delta=step, delta_unit=metrics.Unit.frames, all_pairs=True)
        evos = evo_statistics(metric, pair)
        for statistic in ("rmse", "mean"):
            assert getattr(found, key.format(statistic)) == pytest.approx(evos[statistic], abs=SIX_DIGITS)
    assert found.pairs == COUNT - step


def test_alignments_find_a_path_that_was_only_moved():
    """A path that is turned, shifted and scaled has an error as it is, some after SE3 and none after Sim3."""
    truth = np.asarray(camera_poses(COUNT).translation)
    moved = Similarity(1.1, Rotation.from_rotvec([0.3, 1.0, -0.4]), np.array([3.0, 1.0, 0.2])).apply(truth)
    found = AbsoluteError.of(moved, truth)
    spread = np.sqrt(((truth - truth.mean(axis=0)) ** 2).sum(axis=1).mean())
    assert found.unaligned > 1
    assert found.se3_aligned == pytest.approx(0.1 * spread, rel=1e-9)
    assert found.sim3_aligned == pytest.approx(0, abs=1e-9)


@given(st.integers(0, 10_000), st.integers(3, 30))
@settings(max_examples=60)
def test_each_alignment_errs_no_more_than_the_one_before(seed, count):
    rng = np.random.default_rng(seed)
    found = AbsoluteError.of(*rng.normal(size=(2, count, 3)))
    assert found.sim3_aligned <= found.se3_aligned + 1e-9 <= found.unaligned + 2e-9


@given(st.integers(0, 10_000))
@settings(max_examples=30)
def test_relative_errors_do_not_depend_on_where_either_path_starts(seed):
    rng = np.random.default_rng(seed)
    turn, other = (RigidTransform.from_exp_coords(rng.normal(size=6)) for _ in range(2))
    truth, pairs = camera_poses(12), pairs_in_order(12)
    estimate = disturbed(truth, seed)
    before = relative_pose_errors(estimate, truth, pairs)
    for first, second in zip(before, relative_pose_errors(turn * estimate, other * truth, pairs), strict=True):
        np.testing.assert_allclose(first, second, atol=1e-6)


def test_one_wrong_pose_spoils_two_motions():
    truth = camera_poses(10)
    centers = np.array(truth.translation)
    centers[4] += (0.0, 0.5, 0.0)
    position_m, rotation_deg = relative_pose_errors(
        RigidTransform.from_components(centers, truth.rotation), truth, pairs_in_order(10)
    )
    np.testing.assert_allclose(position_m, np.where(np.isin(np.arange(9), [3, 4]), 0.5, 0), atol=1e-12)
    np.testing.assert_allclose(rotation_deg, 0, atol=1e-5)


def test_pairs_a_second_apart_take_the_nearest_within_tolerance():
    times = np.array([0, 400, 900, 1_300, 1_360, 2_700]) * 1_000_000
    pairs = pairs_apart(times, 1_000_000_000, 250_000_000)
    assert pairs.tolist() == [[0, 2], [1, 4]]
    assert pairs_apart(times[:1], 1_000_000_000, 250_000_000).shape == (0, 2)
    assert pairs_apart(times[:0], 1_000_000_000, 250_000_000).shape == (0, 2)
    assert pairs_in_order(3, 2).tolist() == [[0, 2]]
    assert pairs_in_order(2, 5).shape == (0, 2)


def test_outliers_are_the_papers():
    """Section VII: off by more than 2 m or more than 90 degrees; one that is both counts once."""
    outliers = Outliers.of(np.array([0.1, 2.0, 2.1, 3.0]), np.array([91.0, 90.0, 5.0, 120.0]))
    assert (outliers.frames, outliers.position, outliers.rotation, outliers.count) == (4, 2, 2, 3)
    assert outliers.share == 0.75
    assert Outliers.of(np.zeros(0), np.zeros(0)).share == math.inf


def test_frames_without_pose_are_no_outliers_but_count_in_percentiles():
    status = np.full(COUNT, PoseStatus.REGISTERED.value)
    status[40:] = PoseStatus.NONE.value
    truth = camera_poses(COUNT)
    trajectory = Trajectory.from_poses(TIMES, status, np.ones(COUNT, bool), np.arange(40), truth[:40])
    found = evaluate(trajectory, TIMES, truth)
    assert found.outliers == Outliers(frames=40, position=0, rotation=0, count=0)
    assert found.position_m.p75 == found.position_m.p90 == found.position_m.p95 == math.inf
    assert found.position_m.max < 1e-6
    assert (found.ate_m.frames, found.rpe_in_order.pairs, found.rpe_per_second.pairs) == (40, 39, 30)


@given(st.lists(st.floats(0, 100), min_size=1, max_size=40), st.floats(0, 100))
@settings(max_examples=100)
def test_percentiles_of_finite_errors_are_numpys(errors, percent):
    expected = np.percentile(errors, percent)
    assert percentile(np.array(errors), percent) == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_percentiles_rise_and_end_in_infinity():
    summary = ErrorSummary.of(np.array([*np.linspace(0.1, 1, 17), *[math.inf] * 3]))
    assert summary.median < summary.p75 < summary.max == 1.0
    assert summary.p90 == summary.p95 == math.inf
    assert summary.to_json()["p90"] is None
    with pytest.raises(GeometryError, match="no errors"):
        percentile(np.zeros(0), 50)


def test_too_few_poses_have_no_error_after_an_alignment():
    poses = camera_poses(2)
    found = AbsoluteError.of(np.asarray(poses.translation) + 1, np.asarray(poses.translation))
    assert found.unaligned == pytest.approx(math.sqrt(3))
    assert found.to_json() == {"frames": 2, "unaligned": found.unaligned, "se3_aligned": None, "sim3_aligned": None}
    assert RelativeError.of(poses, poses, pairs_in_order(1)).to_json()["position_rmse_m"] is None


def test_centres_at_one_place_are_moved_onto_the_middle_of_the_true_ones():
    truth = np.asarray(camera_poses(8).translation)
    for with_scale in (False, True):
        aligned = aligned_centers(np.ones((8, 3)), truth, with_scale=with_scale)
        np.testing.assert_allclose(aligned, np.broadcast_to(truth.mean(axis=0), (8, 3)), atol=1e-9)
