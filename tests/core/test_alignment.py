"""Alignments find the truth, find who is wrong, say how sure they are, and survive JSON."""

import json

import numpy as np
import pytest
from box_room import SFM_FROM_SCAN, TAG_SIZE_M, make_room, perturbed, pose_errors_of
from data import SHARED, needs_shared
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from gazeloc_core.alignment.alignment import Alignment, AlignmentMethod, AlignOptions, align, consensus, judge
from gazeloc_core.alignment.correspondences import CLICKED_SIGMA_M, Correspondences, gather, rough_scale
from gazeloc_core.alignment.evidence import reprojection_px
from gazeloc_core.alignment.left_out import leave_one_out
from gazeloc_core.alignment.similarity_fit import fit_similarity, residuals, solve_umeyama
from gazeloc_core.errors import GeometryError, ProjectError
from gazeloc_core.keypoints import KeypointPair, KeypointSet
from gazeloc_core.tag_types import TagCorners
from gazeloc_core.transforms import Similarity

SCAN_FROM_SFM = SFM_FROM_SCAN.inverse()
CORNERS_OF_ROOM = np.array(
    [[-2.4, 1.2, 1.9], [2.4, 0.9, -1.9], [2.3, -1.2, 1.8], [-2.4, -1.1, -1.9], [0, 0, 2], [0.3, 1, -2]]
)


def clicked(scan, noise_m: float = 0.0, seed: int = 0, sigma_m: float = 0.01) -> Correspondences:
    scan = np.asarray(scan, float)
    names = tuple(f"point {i}" for i in range(len(scan)))
    sfm = SFM_FROM_SCAN.apply(scan)
    noisy = scan + np.random.default_rng(seed).normal(0, noise_m, scan.shape)
    return Correspondences(names, names, sfm, noisy, np.full(len(scan), sigma_m))


def with_scan(pairs: Correspondences, scan) -> Correspondences:
    return Correspondences(pairs.names, pairs.groups, pairs.sfm, scan, pairs.sigma_m)


def texts(alignment: Alignment, level: str) -> str:
    return " ".join(verdict.text for verdict in alignment.verdicts if verdict.level == level)


@given(
    st.floats(0.01, 100),
    st.lists(st.floats(-3, 3), min_size=3, max_size=3),
    st.lists(st.floats(-50, 50), min_size=3, max_size=3),
    st.integers(3, 30),
    st.integers(0, 10_000),
)
@settings(max_examples=100)
def test_umeyama_recovers_any_similarity(scale, rotvec, translation, count, seed):
    rng = np.random.default_rng(seed)
    truth = Similarity(scale, Rotation.from_rotvec(rotvec), np.array(translation))
    sfm = rng.normal(size=(count, 3))
    found = fit_similarity(sfm, truth.apply(sfm), rng.uniform(0.1, 2, count))
    assert np.abs(found.as_matrix() - truth.as_matrix()).max() < 1e-9 * max(scale, 50)


def test_umeyama_has_the_least_squares():
    rng = np.random.default_rng(3)
    sfm, scan, weights = rng.normal(size=(8, 3)), rng.normal(size=(8, 3)), rng.uniform(0.2, 3, 8)

    def cost(similarity: Similarity) -> float:
        return float((weights * ((similarity.apply(sfm) - scan) ** 2).sum(axis=1)).sum())

    best = fit_similarity(sfm, scan, weights)
    for seed in range(200):
        near = perturbed(best, 0.01, 0.5, seed)
        assert cost(near) > cost(best)
        assert cost(Similarity(best.scale * 1.01, best.rotation, best.translation)) > cost(best)


@needs_shared
def test_umeyama_on_a_real_cloud_and_its_scaled_copy():
    """Facts of the data: scale 1.04, yaw 0.2 rad, shift (2, 2, 2)."""
    clouds = np.load(SHARED / "registration_pairs" / "car_cloud_similarity.npz")
    found = fit_similarity(clouds["cloud400"], clouds["cloud400_scaled"])
    assert found.scale == pytest.approx(1.04, abs=1e-5)
    np.testing.assert_allclose(found.rotation.as_rotvec(), [0, 0, 0.2], atol=1e-5)
    np.testing.assert_allclose(found.translation, [2, 2, 2], atol=1e-4)


def test_weights_equal_repetition():
    pairs = clicked(CORNERS_OF_ROOM, noise_m=0.05)
    repeated = np.array([0, 0, 0, 1, 2, 3, 4, 5])
    weights = np.array([3.0, 1, 1, 1, 1, 1])
    first = fit_similarity(pairs.sfm, pairs.scan, weights)
    second = fit_similarity(pairs.sfm[repeated], pairs.scan[repeated])
    np.testing.assert_allclose(first.as_matrix(), second.as_matrix(), atol=1e-12)


def test_batches_equal_single_fits():
    rng = np.random.default_rng(0)
    sfm, scan, weights = rng.normal(size=(5, 4, 3)), rng.normal(size=(5, 4, 3)), np.ones((5, 4))
    batched = solve_umeyama(sfm, scan, weights)
    for i in range(5):
        for whole, single in zip(batched, solve_umeyama(sfm[i], scan[i], weights[i]), strict=True):
            np.testing.assert_allclose(whole[i], single, atol=1e-12)


def test_three_pairs_are_enough_and_said_to_be_few():
    alignment = align(clicked(CORNERS_OF_ROOM[:3]))
    np.testing.assert_allclose(alignment.scan_from_sfm.as_matrix(), SCAN_FROM_SFM.as_matrix(), atol=1e-9)
    assert "Only 3 places" in texts(alignment, "warning")
    assert all(point.leave_one_out_m is None for point in alignment.evidence.keypoints)


@pytest.mark.parametrize(
    ("scan", "sentence"),
    [
        (CORNERS_OF_ROOM[:0], "There are 0 keypoint pairs"),
        (CORNERS_OF_ROOM[:2], "There are 2 keypoint pairs"),
        (CORNERS_OF_ROOM[[0, 0, 0, 0]], "at 1 different places"),
        (CORNERS_OF_ROOM[[0, 0, 1, 1]], "at 2 different places"),
        (np.outer(np.arange(5), [1.0, 0.5, 0.2]), "on one line"),
        (np.outer(np.arange(5), [1.0, 0.5, 0.2]) + 1e-3 * CORNERS_OF_ROOM[:5], "on one line"),
    ],
)
def test_geometry_that_determines_nothing_is_refused(scan, sentence):
    with pytest.raises(GeometryError, match=sentence):
        align(clicked(scan))


def test_mirrored_pairs_are_refused():
    pairs = clicked(CORNERS_OF_ROOM)
    with pytest.raises(GeometryError, match="mirror image"):
        align(with_scan(pairs, pairs.scan * [-1, 1, 1]))


def test_pairs_in_one_plane_are_not_called_mirrored():
    scan = CORNERS_OF_ROOM * [1, 1, 0]
    alignment = align(clicked(scan, noise_m=0.005))
    assert "nearly in one plane" in texts(alignment, "warning")


def test_swapped_pairs_are_named():
    pairs = clicked(CORNERS_OF_ROOM, noise_m=0.005)
    scan = pairs.scan.copy()
    scan[[1, 4]] = scan[[4, 1]]
    assert "point 1 and point 4 look swapped" in texts(align(with_scan(pairs, scan)), "bad")


@pytest.mark.parametrize("seed", range(10))
def test_wrong_clicks_are_found(seed):
    rng = np.random.default_rng(seed)
    scan = rng.uniform([-2.4, -1.2, -1.9], [2.4, 1.2, 1.9], (9, 3))
    pairs = clicked(scan, noise_m=0.01, seed=seed)
    wrong = pairs.scan.copy()
    wrong[[2, 6]] += [[0.2, -0.1, 0.15], [-0.3, 0.6, 0.2]]
    alignment = align(with_scan(pairs, wrong))
    flags = [point.is_inlier for point in alignment.evidence.keypoints]
    assert flags == [i not in (2, 6) for i in range(9)]
    assert "point 2" in texts(alignment, "warning")
    assert "point 6" in texts(alignment, "warning")


def test_the_corners_of_a_wrong_tag_fall_together():
    room = make_room(tag_noise_m=0.005)
    corners = room.scan_tags.corners.copy()
    corners[3] += [0.3, 0.0, 0.1]
    corners[3, 0] -= [0.3, 0.0, 0.1]  # one corner happens to be right: it must not stay alone
    tags = TagCorners(room.scan_tags.tag_id, corners, room.scan_tags.sightings, room.scan_tags.spread)
    alignment = align(gather(tags, room.sfm_tags, KeypointSet()), model=room.model)
    wrong = {point.group for point in alignment.evidence.keypoints if not point.is_inlier}
    assert wrong == {"tag 3"}
    assert sum(not point.is_inlier for point in alignment.evidence.keypoints) == 4
    assert pose_errors_of(room, alignment.scan_from_sfm)[0] < 0.02


def test_one_wrong_click_of_four_is_noticed_but_nobody_is_blamed():
    pairs = clicked(CORNERS_OF_ROOM[:4])
    scan = pairs.scan.copy()
    scan[2] += 0.5
    alignment = align(with_scan(pairs, scan))
    assert alignment.evidence.is_contradictory
    assert all(point.is_inlier for point in alignment.evidence.keypoints)
    assert "too few to say which" in texts(alignment, "bad")


def test_leave_one_out_is_the_fit_to_the_others():
    pairs = clicked(CORNERS_OF_ROOM, noise_m=0.02)
    fits = leave_one_out(pairs, np.ones(6, bool))
    assert fits.is_determined.all()
    for i in range(6):
        others = np.arange(6) != i
        expected = fit_similarity(pairs.sfm[others], pairs.scan[others])
        np.testing.assert_allclose(fits.apply(i, pairs.sfm), expected.apply(pairs.sfm), atol=1e-12)
        np.testing.assert_allclose(fits.residuals()[i], residuals(expected, pairs)[i], atol=1e-12)


def test_leave_one_out_predicts_new_keypoints_where_residuals_flatter():
    """Over many draws: residual < noise < error at a new place <= leave-one-out, all root mean square."""
    inside, outside, left_out = [], [], []
    new = np.array([[1.0, 0.5, 0.5], [-1.0, -0.5, 1.0]])
    for seed in range(150):
        evidence = align(clicked(CORNERS_OF_ROOM, noise_m=0.01, seed=seed, sigma_m=0.05))
        inside.append(evidence.evidence.residual_rms_m)
        left_out.append(evidence.evidence.leave_one_out_rms_m)
        noise = np.random.default_rng(10_000 + seed).normal(0, 0.01, new.shape)
        found = evidence.scan_from_sfm.apply(SFM_FROM_SCAN.apply(new))
        outside.append(np.sqrt((np.linalg.norm(found - new - noise, axis=1) ** 2).mean()))
    rms = [np.sqrt(np.mean(np.square(values))) for values in (inside, outside, left_out)]
    assert rms[0] < 0.01 * np.sqrt(3) < rms[1] < rms[2]


def test_predicted_uncertainty_is_the_spread_over_draws():
    room = make_room(points=500)
    errors, predicted = [], []
    for seed in range(200):
        alignment = align(clicked(CORNERS_OF_ROOM, noise_m=0.01, seed=seed), model=room.model)
        geometry = alignment.evidence.geometry
        cameras = alignment.scan_from_sfm.apply(room.model.sfm_from_camera.translation)
        turn = (alignment.scan_from_sfm.rotation * SCAN_FROM_SFM.rotation.inv()).magnitude()
        centres = np.linalg.norm(cameras - room.scan_from_camera.translation, axis=1)
        errors.append((np.rad2deg(turn) ** 2, (centres**2).mean()))
        predicted.append((geometry.rotation_uncertainty_deg, geometry.camera_uncertainty_m))
    actual = np.sqrt(np.mean(errors, axis=0))
    np.testing.assert_allclose(np.median(predicted, axis=0), actual, rtol=0.25)


def test_keypoints_close_together_are_called_so():
    room = make_room(points=500)
    scan = np.array([1.0, 0, 0]) + 0.05 * CORNERS_OF_ROOM
    alignment = align(clicked(scan, noise_m=0.005), model=room.model)
    assert "far from them" in texts(alignment, "warning")
    assert "lie farther apart" in texts(alignment, "bad")


@pytest.mark.parametrize(("given_size_m", "level"), [(TAG_SIZE_M, "good"), (0.2, "bad")])
def test_tag_size_checks_the_scale(given_size_m, level):
    room = make_room(points=500)
    alignment = align(room.pairs, AlignOptions(tag_size_m=given_size_m))
    assert alignment.evidence.tag_scale == pytest.approx(TAG_SIZE_M / given_size_m, rel=1e-6)
    assert "Tags come out" in texts(alignment, level)


@pytest.mark.parametrize(
    ("on_scan", "level", "said"),
    [
        (0.8, "bad", "the scan is too small by as much"),
        (1.0, "bad", "Check the tag size and the worst keypoints"),
        (None, "bad", "Check the tag size and the worst keypoints"),
    ],
)
def test_a_scan_of_another_scale_is_told_from_wrong_keypoints(on_scan, level, said):
    room = make_room(points=500)
    alignment = align(room.pairs, AlignOptions(tag_size_m=TAG_SIZE_M / 0.8, scan_tag_scale=on_scan))
    assert said in texts(alignment, level)
    assert ("on the scan" in texts(alignment, level)) == (on_scan is not None)


def test_advice_on_bad_keypoints_is_for_what_they_are():
    tags = align(make_room(points=500, tag_noise_m=0.04).pairs)
    assert "was a tag moved, or bent?" in texts(tags, "warning") + texts(tags, "bad")
    by_hand = align(clicked(CORNERS_OF_ROOM, noise_m=0.04))
    assert "click in the middle of flat things" in texts(by_hand, "warning") + texts(by_hand, "bad")


def test_residual_in_pixels_is_that_of_the_images_in_view():
    room = make_room(points=500)
    pairs = clicked(CORNERS_OF_ROOM[4:5])
    moved = with_scan(pairs, pairs.scan + np.array([0.02, 0, 0]))
    found = reprojection_px(SCAN_FROM_SFM, moved, room.model, nearest=1000)
    camera = room.model.camera_of(0)
    expected = []
    for pose in room.scan_from_camera:
        first, second = (camera.project(pose.inv().apply(np.array(p)))[0] for p in (pairs.scan, moved.scan))
        if camera.contains([first])[0] and camera.contains([second])[0]:
            expected.append(np.linalg.norm(first - second))
    assert len(expected) > 3
    assert found[0] == pytest.approx(np.mean(expected), rel=1e-6)


def test_json_round_trip_keeps_every_bit_and_the_name():
    room = make_room(tag_noise_m=0.01, points=500)
    for alignment in (align(room.pairs, model=room.model), judge(SCAN_FROM_SFM, room.pairs)):
        again = Alignment.from_json(json.loads(json.dumps(alignment.to_json(), allow_nan=False)))
        assert again == alignment
        assert again.key == alignment.key
        assert (again.scan_from_sfm.as_matrix() == alignment.scan_from_sfm.as_matrix()).all()


def test_a_changed_file_is_noticed():
    value = align(clicked(CORNERS_OF_ROOM)).to_json()
    with pytest.raises(ProjectError, match="was changed"):
        Alignment.from_json({**value, "scale": value["scale"] * 1.001})
    for broken in ({}, None, {**value, "wxyz": [0, 0, 0, 0]}, {**value, "method": "guess"}):
        with pytest.raises(ProjectError, match="garbled"):
            Alignment.from_json(broken)


def test_an_alignment_from_elsewhere_is_measured_but_not_flattered():
    room = make_room(tag_noise_m=0.01, points=500)
    alignment = judge(perturbed(SCAN_FROM_SFM, 0.05, 1.0, 0), room.pairs, method=AlignmentMethod.GIVEN)
    assert not alignment.evidence.is_fitted
    assert alignment.evidence.leave_one_out_rms_m is None
    assert alignment.evidence.residual_rms_m > 0.04


def test_without_keypoints_an_alignment_says_that_nothing_measures_it():
    nothing = gather(None, None, KeypointSet())
    assert "No keypoints measure" in texts(judge(SCAN_FROM_SFM, nothing), "warning")
    assert len(consensus(nothing)) == 0


def test_gather_joins_tags_by_id_and_counts_enabled_clicks_only():
    room = make_room(points=500)
    some = TagCorners(np.array([5, 9, 2]), room.sfm_tags.corners[[5, 0, 2]], np.ones(3), np.zeros(3))
    keypoints = KeypointSet(
        (
            KeypointPair("k1", "window", (0.0, 1.0, 2.0), (0.1, 0.2, 0.3)),
            KeypointPair("k2", "door", (1.0, 1.0, 2.0), (0.1, 0.2, 0.4), enabled=False),
            KeypointPair("k3", "lamp", (1.0, 1.0, 1.0), None),
        )
    )
    pairs = gather(room.scan_tags, some, keypoints)
    assert pairs.group_names == ("tag 2", "tag 5", "k1")
    np.testing.assert_array_equal(pairs.sfm[4:8], room.sfm_tags.corners[5])
    np.testing.assert_array_equal(pairs.scan[4:8], room.scan_tags.corners[5])
    assert pairs.names[-1] == "window"
    assert pairs.weights[:8].sum() * 0.01**2 == pytest.approx(2)  # a tag weighs as one observation


def test_what_is_known_about_either_side_of_a_clicked_keypoint_adds_to_its_expected_error():
    places = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)]
    sigmas = [{}, {"scan_sigma": 0.03}, {"scan_sigma": 0.03, "sfm_sigma": 0.02}]
    pairs = [
        KeypointPair(f"k{i}", "", place, tuple(x / 2 for x in place), **sigma)
        for i, (place, sigma) in enumerate(zip(places, sigmas, strict=True))
    ]
    found = gather(None, None, KeypointSet(tuple(pairs))).sigma_m
    own = CLICKED_SIGMA_M**2
    np.testing.assert_allclose(found**2, [own, own + 0.03**2, own + 0.03**2 + 0.04**2])


def test_the_rough_scale_of_thousands_of_pairs_is_known_without_comparing_each_with_each():
    scan = np.random.default_rng(0).normal(size=(200_000, 3))  # each with each would be 20 thousand million pairs
    assert rough_scale(scan / 3, scan) == pytest.approx(3)
    assert rough_scale(scan[:1], scan[:1]) == rough_scale(scan[:0], scan[:0]) == 1
