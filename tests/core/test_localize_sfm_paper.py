"""Method `sfm-paper`: faithful, with its faults: no tag is ever doubted, ICP always has the last word."""

from dataclasses import replace

import numpy as np
import pytest
from box_room import make_room, pose_errors_of
from data import SAMPLE_SCENES
from scipy.spatial.transform import Rotation

from gazeloc_core.alignment.alignment import AlignmentMethod
from gazeloc_core.alignment.paper_keypoints import TagCenters, scan_tag_centers, sfm_tag_centers
from gazeloc_core.errors import Cancelled, GeometryError, InputError
from gazeloc_core.evaluation.evaluate import pose_errors
from gazeloc_core.evaluation.truth import read_tum
from gazeloc_core.frames.undistort import Undistorter
from gazeloc_core.localize.sfm_paper import AlignPaperOptions, align_paper
from gazeloc_core.readers import open_recording, open_scan
from gazeloc_core.scan import Mesh
from gazeloc_core.sfm.colmap_io import read_model
from gazeloc_core.sfm.colmap_join import join_to_recording
from gazeloc_core.surfaces.raycast import Raycaster
from gazeloc_core.tags.detection import TagOptions, detect_tags
from gazeloc_core.transforms import Similarity

POSITION_M, ROTATION_DEG = 0.005, 0.1
"""What sampling the scan at 100,000 points costs at most, without any other noise."""


@pytest.fixture(scope="module")
def room():
    return make_room(points=3000)


def centers_of(corners) -> TagCenters:
    places = dict(zip(corners.tag_id.tolist(), corners.centers, strict=True))
    return TagCenters.of({tag: place[None] for tag, place in places.items()}, [])


def aligned(room, *, scan_centers=None, mesh=None, options=None):
    on_scan, in_sfm = centers_of(room.scan_tags), centers_of(room.sfm_tags)
    return align_paper(scan_centers or on_scan, in_sfm, room.model, mesh or room.mesh, options)


def with_wrong_tag(room, shift_m: float) -> TagCenters:
    right = centers_of(room.scan_tags)
    moved = right.centers.copy()
    moved[3] += (0, shift_m, 0)
    return replace(right, centers=moved)


def test_exact_tags_and_points_give_the_truth(room):
    found = aligned(room)
    assert pose_errors_of(room, found.start.scan_from_sfm)[0] < 1e-9
    position_m, rotation_deg = pose_errors_of(room, found.refined.scan_from_sfm)
    assert position_m < POSITION_M
    assert rotation_deg < ROTATION_DEG
    assert found.icp_fitness > 0.99


def test_no_tag_is_left_out_however_wrong(room):
    """The start is the least-squares answer over all tags: no small change of it has a smaller sum of squares."""
    found = aligned(room, scan_centers=with_wrong_tag(room, 0.5))
    pairs, best = found.pairs, found.start.scan_from_sfm
    assert all(point.is_inlier for point in found.start.evidence.keypoints)

    def cost(similarity):
        return float(np.sum((similarity.apply(pairs.sfm) - pairs.scan) ** 2))

    about_middle = Similarity(1.0, Rotation.identity(), pairs.scan.mean(axis=0))
    rng = np.random.default_rng(0)
    for _ in range(200):
        turn, shift = Rotation.from_rotvec(rng.normal(0, 1e-3, 3)), rng.normal(0, 1e-3, 3)
        change = about_middle * Similarity(1 + rng.normal(0, 1e-3), turn, shift) * about_middle.inverse()
        assert cost(change * best) > cost(best)
    assert pose_errors_of(room, best)[0] > 0.02


def test_a_wrong_tag_is_named_by_the_evidence(room):
    found = aligned(room, scan_centers=with_wrong_tag(room, 0.5))
    assert [p.name for p in found.refined.evidence.keypoints if not p.is_inlier] == ["tag 3"]


def test_icp_changes_no_scale(room):
    found = aligned(room, scan_centers=with_wrong_tag(room, 0.1))
    assert found.start.scale != pytest.approx(room.scan_from_sfm.scale, rel=1e-3)
    assert found.refined.scale == pytest.approx(found.start.scale, rel=1e-12)


def test_icp_is_taken_even_where_it_ruins_the_alignment(room):
    shifted = Mesh(room.mesh.vertices + np.array([0.03, 0.02, 0.02]), room.mesh.faces)
    found = aligned(room, mesh=shifted)
    before, after = (pose_errors_of(room, a.scan_from_sfm)[0] for a in (found.start, found.refined))
    assert before < 1e-9
    assert 0.02 < after < 0.045
    assert found.refined.evidence.residual_rms_m > 0.02


def test_both_alignments_name_where_they_come_from(room):
    found = aligned(room)
    assert found.start.method is AlignmentMethod.KEYPOINTS
    assert found.start.evidence.is_fitted
    assert found.refined.method is AlignmentMethod.ICP_POINT_TO_POINT
    assert not found.refined.evidence.is_fitted
    assert found.refined.parent == found.start.key


def test_the_same_seed_gives_the_same_answer(room):
    first, again, other = (aligned(room, options=AlignPaperOptions(seed=s)).refined.key for s in (0, 0, 1))
    assert first == again != other


def test_tags_on_one_line_are_a_sentence(room):
    line = TagCenters.of({tag: np.array([[tag * 0.5, 0.0, 0.0]]) for tag in range(4)}, [])
    with pytest.raises(GeometryError, match="lie on one line"):
        align_paper(line, line, room.model, room.mesh)


def test_two_common_tags_are_a_sentence(room):
    on_scan = centers_of(room.scan_tags)
    two = TagCenters(on_scan.tag_id[:2], on_scan.centers[:2], on_scan.support[:2], on_scan.spread[:2])
    with pytest.raises(GeometryError, match="three tags on both sides, but there are 2"):
        aligned(room, scan_centers=two)


def test_points_that_are_nowhere_near_the_scan_are_a_sentence(room):
    away = Mesh(room.mesh.vertices + 30.0, room.mesh.faces)
    with pytest.raises(GeometryError, match=r"None of the reconstruction's 3000 points is within 0\.05 m"):
        aligned(room, mesh=away)


@pytest.mark.parametrize(
    "field",
    [{"icp_distance_m": 0.0}, {"icp_iterations": -1}, {"samples": 0}, {"seed": -1}],
    ids=lambda f: next(iter(f)),
)
def test_options_that_cannot_be_are_refused(field):
    with pytest.raises(InputError, match="above 0"):
        AlignPaperOptions(**field)


def test_it_can_be_cancelled(room):
    def report(fraction, text=""):
        if fraction >= 0.3:
            raise Cancelled("stopped")

    with pytest.raises(Cancelled):
        align_paper(centers_of(room.scan_tags), centers_of(room.sfm_tags), room.model, room.mesh, report=report)


@pytest.mark.slow
def test_the_whole_recipe_on_the_sample_scene():
    """From the files: tags found in the pictures of both sides, the shipped reconstruction, the mesh as scanned."""
    scene = SAMPLE_SCENES / "studio"
    scan, recording = open_scan(scene / "scan"), open_recording(scene / "recording")
    undistorter = Undistorter.of(recording.camera)
    model = read_model(scene / "colmap")
    model = replace(model, frame_indices=join_to_recording(model, recording, undistorter.target, None))
    options = TagOptions(family="tag36h11")
    phone = ((i, frame.read_image()) for i, frame in enumerate(scan.frames_with_images))
    on_scan = detect_tags(phone, len(scan.frames_with_images), options)
    glasses = ((i, undistorter.image(rgb)) for i, rgb in recording.frames.iterate(model.frame_indices.tolist()))
    in_frames = detect_tags(glasses, len(model), options)
    found = align_paper(
        scan_tag_centers(scan, Raycaster(scan.mesh), on_scan),
        sfm_tag_centers(model, undistorter.target, in_frames).centers,
        model,
        scan.mesh,
    )
    times, poses = read_tum(scene / "truth" / "glasses.tum")
    rows = np.searchsorted(times, recording.timestamp_ns[model.frame_indices] - 1_000_000)
    rotation_deg, position_m = pose_errors(found.refined.scan_from_sfm.compose_pose(model.sfm_from_camera), poses[rows])
    assert position_m.mean() < 0.03
    assert rotation_deg.mean() < 0.6
