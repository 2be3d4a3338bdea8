"""The paper's chain of two tag poses: exact where they are, and faithful to its recipe where they are not."""

from pathlib import Path

import numpy as np
import pytest
from box_room import room_mesh
from scipy.spatial.transform import RigidTransform
from tag_walk import PINHOLE, TAG_SIZE_M, Walk, errors, pick, walk

from gazeloc_core.camera import Camera
from gazeloc_core.errors import GeometryError, InputError
from gazeloc_core.localize.tag_localization import TagLocalization
from gazeloc_core.localize.tags_paper import TagsPaperOptions, localize_tags_paper
from gazeloc_core.scan import RoomScan, ScanFrame
from gazeloc_core.tag_types import TagSightings

EXACT_M = 1e-3
PHONE = walk(seconds=9.0, hz=2.0)


def scan_of(poses: RigidTransform, camera: Camera = PINHOLE) -> RoomScan:
    """The phone's scan; its first frame has no picture, so that sightings count from the second on."""
    frames = [ScanFrame(f"{k}", k, camera, poses[k], Path(f"{k}.jpg")) for k in range(len(poses))]
    return RoomScan(Path("scan"), "test", room_mesh(), (ScanFrame("bare", -1, camera, poses[0]), *frames))


SCAN = scan_of(PHONE.truth)


def localized(
    path: Walk, seen_by_phone: TagSightings = PHONE.sightings, size_m: float | None = TAG_SIZE_M, **more
) -> TagLocalization:
    keyframes = np.arange(0, len(path.timestamp_ns), 10)
    stamps = path.timestamp_ns
    return localize_tags_paper(stamps, keyframes, PINHOLE, path.sightings, SCAN, seen_by_phone, size_m, **more)


def shifted(sightings: TagSightings, which: np.ndarray, by_px: float) -> TagSightings:
    """The sightings, some of them (a mask) with corners that are off sideways."""
    corners = sightings.corners_px + np.where(which, by_px, 0.0)[:, None, None]
    return TagSightings(sightings.frame_index, sightings.tag_id, corners, sightings.decision_margin)


def test_exact_sightings_give_exact_poses_to_all_frames_that_show_a_tag_of_the_phone():
    path = walk()
    answer = localized(path)
    expected = np.full(len(path.timestamp_ns), "none", dtype="U16")
    expected[path.shown] = "tag_only"
    assert set(path.sightings.tag_id.tolist()) <= set(PHONE.sightings.tag_id.tolist())
    assert answer.trajectory.status.tolist() == expected.tolist()
    has_pose = answer.trajectory.has_pose
    shift_m, turn_deg = errors(answer.trajectory.poses(has_pose), path.truth[has_pose])
    assert shift_m.max() < EXACT_M
    assert turn_deg.max() < 0.05
    assert (answer.tags_used[has_pose] == 1).all()
    assert np.nanmax(answer.disagreement_m) < EXACT_M
    assert answer.notes == ()


def test_the_phone_counts_by_its_first_sighting_of_each_tag():
    s = PHONE.sightings
    first = np.zeros(len(s), bool)
    first[np.unique(s.tag_id, return_index=True)[1]] = True  # the walk's sightings are in order of time
    path = walk(seconds=2)
    later_are_bad, first_are_bad = (shifted(s, which, 40) for which in (~first, first))
    has_pose = localized(path).trajectory.has_pose
    right = localized(path, later_are_bad).trajectory
    wrong = localized(path, first_are_bad).trajectory
    assert errors(right.poses(has_pose), path.truth[has_pose])[0].max() < EXACT_M
    assert errors(wrong.poses(has_pose), path.truth[has_pose])[0].min() > 0.02


def test_the_first_sighting_is_first_in_time_whatever_the_order_of_rows():
    path, order = walk(seconds=2), np.random.default_rng(0).permutation(len(PHONE.sightings))
    one, other = localized(path).trajectory, localized(path, pick(PHONE.sightings, order)).trajectory
    np.testing.assert_array_equal(one.centers, other.centers)


def test_the_glasses_count_by_the_tag_that_the_detector_is_surest_of():
    path = walk()
    s = path.sightings
    several = np.isin(s.frame_index, np.flatnonzero(np.bincount(s.frame_index) > 1))
    assert several.any()
    surest = np.array(
        [s.decision_margin[k] == s.decision_margin[s.frame_index == s.frame_index[k]].max() for k in range(len(s))]
    )
    frames = np.unique(s.frame_index[several])
    bad_others = localized(Walk(path.timestamp_ns, path.truth, shifted(s, several & ~surest, 60)))
    bad_surest = localized(Walk(path.timestamp_ns, path.truth, shifted(s, several & surest, 60)))
    assert errors(bad_others.trajectory.poses(frames), path.truth[frames])[0].max() < EXACT_M
    assert errors(bad_surest.trajectory.poses(frames), path.truth[frames])[0].min() > 0.02
    for answer in (bad_others, bad_surest):  # both say that the tags of these frames disagree
        assert answer.disagreement_m[frames].min() > 0.05
        assert answer.tags_used[frames].tolist() == [1] * len(frames)


def test_the_ambiguity_is_shown_and_not_resolved():
    path = walk(noise_px=1.0, seed=2)
    answer = localized(path)
    assert answer.is_ambiguous.any()
    assert answer.trajectory.has_pose[answer.is_ambiguous].all()
    assert localized(path, options=TagsPaperOptions(ambiguous_ratio=10.0)).is_ambiguous.sum() == 0
    shift_m, _ = errors(answer.trajectory.poses(answer.trajectory.has_pose), path.truth[answer.trajectory.has_pose])
    assert shift_m.max() > 0.5  # the recipe's own weakness; were it gone, this would not be the paper's method


def test_a_tag_that_the_phone_never_saw_gives_no_pose_and_a_sentence():
    path = walk()
    unseen = int(path.sightings.tag_id[0])
    answer = localized(path, pick(PHONE.sightings, PHONE.sightings.tag_id != unseen))
    only = [f for f in path.shown if set(path.sightings.tag_id[path.sightings.frame_index == f].tolist()) == {unseen}]
    assert (answer.trajectory.status[only] == "none").all()
    assert answer.notes == (f"Tag {unseen} is seen by the glasses but not on the scan.",)


def test_nothing_seen_on_either_side_gives_no_pose():
    path, nothing = walk(seconds=0.3), pick(PHONE.sightings, np.zeros(len(PHONE.sightings), bool))
    assert set(localized(path, nothing).trajectory.status.tolist()) == {"none"}
    assert set(localized(Walk(path.timestamp_ns, path.truth, nothing)).trajectory.status.tolist()) == {"none"}


def test_corners_that_are_no_square_are_rejected():
    path = walk(seconds=0.3)
    corners = path.sightings.corners_px.copy()
    broken = int(path.shown[1])
    corners[path.sightings.frame_index == broken] = np.nan
    s = path.sightings
    answer = localized(
        Walk(path.timestamp_ns, path.truth, TagSightings(s.frame_index, s.tag_id, corners, s.decision_margin))
    )
    assert answer.trajectory.status[broken] == "rejected"
    assert answer.trajectory.has_pose[path.shown[0]]


def test_every_phone_frame_has_its_own_camera():
    zoomed = Camera.pinhole(1088, 1080, 1000.0, 990.0, 530.0, 550.0)
    path = walk(seconds=1)
    corners = (
        PHONE.sightings.corners_px - PINHOLE.principal_point_px
    ) / PINHOLE.focal_px * zoomed.focal_px + zoomed.principal_point_px
    s = PHONE.sightings
    seen = TagSightings(s.frame_index, s.tag_id, corners, s.decision_margin)
    keyframes = np.array([0])
    answer = localize_tags_paper(
        path.timestamp_ns, keyframes, PINHOLE, path.sightings, scan_of(PHONE.truth, zoomed), seen, TAG_SIZE_M
    )
    has_pose = answer.trajectory.has_pose
    assert errors(answer.trajectory.poses(has_pose), path.truth[has_pose])[0].max() < EXACT_M


@pytest.mark.parametrize(
    ("size", "sentence"), [(None, "--tag-size"), (0.0, "tag size is 0.0 m"), (float("nan"), "nan")]
)
def test_it_needs_a_tag_size(size, sentence):
    with pytest.raises(InputError, match=sentence):
        localized(walk(seconds=0.1), size_m=size)


def test_sightings_of_another_scan_are_refused():
    far = TagSightings(np.array([99]), np.array([0]), np.zeros((1, 4, 2)), np.ones(1))
    with pytest.raises(GeometryError, match="phone frame 99, but scan has 18 frames"):
        localized(walk(seconds=0.1), far)
