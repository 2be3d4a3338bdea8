"""ICP reaches the truth from a wrong start, and is refused where keypoints do not vouch for it."""

import json

import numpy as np
import pytest
from box_room import make_room, perturbed, pose_errors_of

from gazeloc_core.alignment.alignment import AlignmentMethod, align, judge
from gazeloc_core.alignment.correspondences import gather
from gazeloc_core.alignment.icp import IcpOptions, Target, choose_points, run_icp
from gazeloc_core.alignment.refine import RefineOptions, decide, refine
from gazeloc_core.errors import Cancelled, GeometryError
from gazeloc_core.keypoints import KeypointSet
from gazeloc_core.scan import Mesh
from gazeloc_core.surfaces.raycast import Raycaster
from gazeloc_core.transforms import Similarity

VARIANTS = [AlignmentMethod.ICP_POINT_TO_POINT, AlignmentMethod.ICP_POINT_TO_PLANE]
NO_PAIRS = gather(None, None, KeypointSet())


@pytest.fixture(scope="module")
def noisy():
    room = make_room(point_noise_m=0.01, mesh_noise_m=0.005, tag_noise_m=0.01, seed=4)
    return room, Raycaster(room.mesh)


def shifted_mesh(room, shift_m):
    """The scan's mesh in the wrong place: ICP's own numbers are perfect there, keypoints know better."""
    return Raycaster(Mesh(room.mesh.vertices + shift_m, room.mesh.faces))


@pytest.mark.parametrize("method", VARIANTS)
def test_icp_converges_to_the_truth_without_noise(method):
    room = make_room()
    target, start = Target(Raycaster(room.mesh)), perturbed(room.scan_from_sfm, 0.05, 1.0, 7)
    points = choose_points(room.model, start, target, IcpOptions())
    found = run_icp(start, points, target, method, IcpOptions(iterations=200))
    position_m, rotation_deg = pose_errors_of(room, found)
    assert position_m < 0.001
    assert rotation_deg < 0.02


def test_icp_with_scale_finds_the_scale():
    room = make_room()
    target, truth = Target(Raycaster(room.mesh)), room.scan_from_sfm
    start = Similarity(truth.scale * 1.02, truth.rotation, truth.translation)
    options = IcpOptions(with_scale=True, iterations=100)
    points = choose_points(room.model, start, target, options)
    found = run_icp(start, points, target, AlignmentMethod.ICP_POINT_TO_PLANE, options)
    assert found.scale == pytest.approx(truth.scale, rel=1e-3)


@pytest.mark.parametrize("seed", range(5))
def test_a_start_off_by_5_cm_and_1_deg_is_repaired_and_accepted(noisy, seed):
    room, raycaster = noisy
    start = judge(perturbed(room.scan_from_sfm, 0.05, 1.0, seed), room.pairs)
    refinement = refine(start, room.model, raycaster, room.pairs)
    position_m, rotation_deg = pose_errors_of(room, refinement.chosen.scan_from_sfm)
    assert refinement.accepted, refinement.reason
    assert position_m <= 0.02
    assert rotation_deg <= 0.3
    assert refinement.chosen.parent == start.key


def test_the_exact_start_does_not_get_worse(noisy):
    room, raycaster = noisy
    refinement = refine(judge(room.scan_from_sfm, room.pairs), room.model, raycaster, room.pairs)
    assert pose_errors_of(room, refinement.chosen.scan_from_sfm)[0] <= 0.012


@pytest.mark.parametrize("is_fitted", [True, False])
def test_icp_that_ruins_an_alignment_is_refused_though_its_own_numbers_improve(is_fitted):
    room = make_room(point_noise_m=0.005, tag_noise_m=0.003)
    raycaster = shifted_mesh(room, np.array([0.05, 0.02, 0.03]))
    start = align(room.pairs) if is_fitted else judge(room.scan_from_sfm, room.pairs)
    refinement = refine(start, room.model, raycaster, room.pairs)
    assert not refinement.accepted
    assert refinement.chosen is start
    assert refinement.best.overlap_after.rms_m < refinement.best.overlap_before.rms_m
    assert refinement.reason.startswith("Refused")


def test_icp_that_does_nothing_never_beats_the_fit_it_inherited():
    """It inherits the residuals of the fit, which leave-one-out residuals exceed: no gain must come of it."""
    for seed in range(10):
        room = make_room(points=2000, tag_noise_m=0.01, seed=seed)
        options = RefineOptions(icp=IcpOptions(iterations=0))
        refinement = refine(align(room.pairs), room.model, Raycaster(room.mesh), room.pairs, options)
        assert not refinement.accepted
        assert refinement.best.keypoints_after_m >= refinement.best.keypoints_before_m


def test_pictures_decide_where_few_poor_keypoints_cannot():
    room = make_room(point_noise_m=0.005, tag_noise_m=0.04, seed=2)
    raycaster, start = Raycaster(room.mesh), align(room.pairs)
    assert not refine(start, room.model, raycaster, room.pairs).accepted

    def agreement(scan_from_sfm):
        return -pose_errors_of(room, scan_from_sfm)[0]

    refinement = refine(start, room.model, raycaster, room.pairs, agreement=agreement)
    assert refinement.accepted, refinement.reason
    before, after = (pose_errors_of(room, a.scan_from_sfm)[0] for a in (start, refinement.chosen))
    assert after < 0.7 * before


def test_without_keypoints_pictures_decide_or_nothing_is_accepted(noisy):
    room, raycaster = noisy
    start = judge(perturbed(room.scan_from_sfm, 0.05, 1.0, 1), NO_PAIRS)

    def agreement(scan_from_sfm):
        return -pose_errors_of(room, scan_from_sfm)[0]

    assert not refine(start, room.model, raycaster, NO_PAIRS).accepted
    assert refine(start, room.model, raycaster, NO_PAIRS, agreement=agreement).accepted


def test_pictures_that_disagree_overrule_keypoints(noisy):
    room, raycaster = noisy
    start = judge(perturbed(room.scan_from_sfm, 0.05, 1.0, 1), room.pairs)

    def agreement(scan_from_sfm):
        return pose_errors_of(room, scan_from_sfm)[0]

    refinement = refine(start, room.model, raycaster, room.pairs, agreement=agreement)
    assert not refinement.accepted
    assert "pictures agree less" in refinement.reason


def test_two_places_are_too_few_to_decide():
    pairs = make_room(points=500).pairs.take(np.arange(8))
    accepted, reason = decide(pairs, np.full(8, 0.05), np.full(8, 0.001), None, None, RefineOptions())
    assert not accepted
    assert "only 2 places" in reason


def test_chance_is_rarely_accepted():
    """Where ICP gains nothing, at most about the significance of draws are accepted."""
    pairs = make_room(points=500).pairs
    rng = np.random.default_rng(0)
    draws = 400
    accepted = 0
    for _ in range(draws):
        before, after = (np.abs(rng.normal(0, 0.015, 6))[pairs.group_index] for _ in range(2))
        accepted += decide(pairs, before, after, None, None, RefineOptions())[0]
    assert 0 < accepted / draws < 0.09


def test_bad_points_are_left_out():
    room = make_room(points=3000)
    far = room.model.points.copy()
    far[:300] += 5.0
    tracks, errors = np.full(3000, 4), np.full(3000, 0.5)
    tracks[300:600], errors[600:900] = 2, 5.0
    changed = {**room.model.__dict__, "points": far, "track_lengths": tracks, "point_errors_px": errors}
    model = type(room.model)(**changed)
    chosen = choose_points(model, room.scan_from_sfm, Target(Raycaster(room.mesh)), IcpOptions(voxel_m=1e-6))
    assert {tuple(point) for point in chosen} == {tuple(point) for point in room.model.points[900:]}


def test_points_beyond_the_rim_of_the_scan_do_not_pull():
    """Half of the room was not scanned: points there must not draw the alignment to where the mesh ends."""
    room = make_room()
    centres = room.mesh.vertices[room.mesh.faces].mean(axis=1)
    half = Mesh(room.mesh.vertices, room.mesh.faces[centres[:, 0] < 0.3])
    target, start = Target(Raycaster(half)), perturbed(room.scan_from_sfm, 0.03, 0.5, 2)
    points = choose_points(room.model, start, target, IcpOptions())
    beyond = room.scan_from_sfm.apply(points)[:, 0] > 0.5
    assert beyond.sum() < 0.01 * len(points)
    found = run_icp(start, points, target, AlignmentMethod.ICP_POINT_TO_PLANE, IcpOptions(iterations=100))
    assert pose_errors_of(room, found)[0] < 0.002


def test_seams_of_a_texture_are_no_rim():
    room = make_room()
    split = Mesh(room.mesh.vertices[room.mesh.faces].reshape(-1, 3), np.arange(3 * len(room.mesh.faces)).reshape(-1, 3))
    points = np.random.default_rng(0).uniform(-1, 1, (300, 3))
    assert Target(Raycaster(split)).nearest(points)[1].all()


def test_a_start_far_from_the_scan_is_a_sentence():
    room = make_room(points=500)
    away = judge(perturbed(room.scan_from_sfm, 20.0, 0.0, 0), room.pairs)
    with pytest.raises(GeometryError, match="lie within"):
        refine(away, room.model, Raycaster(room.mesh), room.pairs)


def test_it_can_be_cancelled(noisy):
    room, raycaster = noisy
    fractions = []

    def report(fraction, text=""):
        fractions.append(fraction)
        if fraction > 0.5:
            raise Cancelled("stopped")

    with pytest.raises(Cancelled):
        refine(align(room.pairs), room.model, raycaster, room.pairs, report=report)
    assert fractions == sorted(fractions)
    assert len(fractions) > 10


def test_the_report_is_strict_json(noisy):
    room, raycaster = noisy
    start = judge(perturbed(room.scan_from_sfm, 0.05, 1.0, 0), room.pairs)
    refinement = refine(start, room.model, raycaster, room.pairs)
    value = json.loads(json.dumps(refinement.to_json(), allow_nan=False))
    assert value["chosen"] == refinement.chosen.key
    assert [c["method"] for c in value["candidates"]] == [method.value for method in VARIANTS]
