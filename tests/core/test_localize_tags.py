"""Frames localised by all their tags: true poses where tags say so, and no pose where they do not."""

import numpy as np
import pytest
from box_room import room_mesh
from scipy.spatial.transform import RigidTransform, Rotation
from tag_walk import PINHOLE, START_NS, Walk, errors, pick, see, true_tag_corners, walk

from gazeloc_core.errors import GeometryError
from gazeloc_core.localize.tag_localization import TagLocalization
from gazeloc_core.localize.tags import LocalizeTagsOptions, localize_tags
from gazeloc_core.surfaces.raycast import Raycaster
from gazeloc_core.tag_types import TagCorners, TagSightings

EXACT = LocalizeTagsOptions(corner_error_px=0.02, place_error_m=1e-4)
TAGS = true_tag_corners()
EXACT_M, EXACT_DEG = 0.002, 0.05


def localized(path: Walk, options: LocalizeTagsOptions | None = None, **more) -> TagLocalization:
    keyframes = np.arange(0, len(path.timestamp_ns), 10)
    corners = more.pop("corners", TAGS)
    return localize_tags(path.timestamp_ns, keyframes, PINHOLE, path.sightings, corners, options, **more)


def errors_of(answer: TagLocalization, path: Walk) -> tuple[np.ndarray, np.ndarray]:
    has_pose = answer.trajectory.has_pose
    return errors(answer.trajectory.poses(has_pose), path.truth[has_pose])


def test_exact_sightings_give_exact_poses_and_nothing_else_any():
    path = walk()
    answer = localized(path, EXACT)
    expected = np.full(len(path.timestamp_ns), "none", dtype="U16")
    expected[path.shown] = "tag_only"
    assert answer.trajectory.status.tolist() == expected.tolist()
    shift_m, turn_deg = errors_of(answer, path)
    assert shift_m.max() < EXACT_M
    assert turn_deg.max() < EXACT_DEG
    assert np.flatnonzero(answer.trajectory.is_keyframe).tolist() == list(range(0, 240, 10))
    counted = np.bincount(path.sightings.frame_index, minlength=240)
    np.testing.assert_array_equal(answer.tags_used, counted)
    has_pose = answer.trajectory.has_pose
    for column in (answer.rms_px, answer.disagreement_m):
        assert (np.isfinite(column) == has_pose).all()
    assert np.nanmax(answer.rms_px) < 0.1
    assert not answer.is_ambiguous.any()
    assert answer.notes == ()


@pytest.mark.parametrize(("noise_px", "edge_px", "seed"), [(0.3, 0.0, 1), (0.3, 0.5, 2), (0.8, 0.0, 3)])
def test_noise_keeps_within_the_numbers_to_reach(noise_px, edge_px, seed):
    path = walk(noise_px=noise_px, edge_px=edge_px, seed=seed)
    answer = localized(path)
    shift_m, turn_deg = errors_of(answer, path)
    assert len(shift_m) >= 0.9 * len(path.shown)
    assert shift_m.mean() < 0.08
    assert turn_deg.mean() < 2
    assert shift_m.max() < 0.3
    assert turn_deg.max() < 10


def test_an_adjusted_walk_is_better_than_frames_by_themselves():
    path = walk(noise_px=0.5, seed=4)
    loose = LocalizeTagsOptions(velocity_change_m_per_s=1e3, spin_change_deg_per_s=1e5, speed_m_per_s=1e3)
    together, alone = (errors_of(localized(path, o), path)[0].mean() for o in (None, loose))
    assert together < 0.8 * alone


def test_the_light_on_edges_is_found_and_taken_off():
    path = walk(noise_px=0.1, edge_px=0.8)
    stubborn = LocalizeTagsOptions(edge_shift_error_px=1e-4)
    assert errors_of(localized(path), path)[0].mean() < 0.8 * errors_of(localized(path, stubborn), path)[0].mean()


def test_a_frame_without_a_mapped_tag_has_no_pose_whatever_its_neighbours_know():
    path = walk()
    some = TagCorners(TAGS.tag_id[1:4], TAGS.corners[1:4], TAGS.sightings[1:4], TAGS.spread[1:4])
    answer = localized(path, corners=some)
    shown = np.unique(path.sightings.frame_index[np.isin(path.sightings.tag_id, some.tag_id)])
    assert (answer.trajectory.status[np.setdiff1d(np.arange(240), shown)] == "none").all()
    assert answer.trajectory.has_pose[shown].mean() > 0.9
    missing = [tag for tag in (0, 4, 5) if tag in path.sightings.tag_id]
    assert missing
    assert all(str(tag) in answer.notes[0] for tag in missing)
    assert "not on the scan" in answer.notes[0]


def test_no_tag_at_all_leaves_every_frame_without_pose():
    path = walk(seconds=0.2)
    nothing = pick(path.sightings, np.zeros(len(path.sightings), bool))
    answer = localized(Walk(path.timestamp_ns, path.truth, nothing))
    assert set(answer.trajectory.status.tolist()) == {"none"}
    assert (answer.tags_used == 0).all()
    nowhere = localized(path, corners=TagCorners(np.empty(0), np.empty((0, 4, 3)), np.empty(0), np.empty(0)))
    assert set(nowhere.trajectory.status.tolist()) == {"none"}


def test_a_single_frame_is_enough_where_its_picture_is_clear():
    path = walk()
    shown_twice = np.flatnonzero(np.bincount(path.sightings.frame_index, minlength=240) > 1)[0]
    only = pick(path.sightings, path.sightings.frame_index == shown_twice)
    answer = localized(Walk(path.timestamp_ns, path.truth, only), EXACT)
    assert np.flatnonzero(answer.trajectory.status == "tag_only").tolist() == [shown_twice]
    assert errors_of(answer, path)[0].max() < EXACT_M


def misplaced(path: Walk, frame: int, shift_px: float) -> Walk:
    """The walk with every tag of one frame seen to the side of where it is."""
    corners = path.sightings.corners_px.copy()
    corners[path.sightings.frame_index == frame] += [shift_px, -shift_px / 2]
    s = path.sightings
    return Walk(path.timestamp_ns, path.truth, TagSightings(s.frame_index, s.tag_id, corners, s.decision_margin))


def test_a_frame_that_contradicts_all_its_neighbours_is_rejected():
    path = walk(noise_px=0.1)
    frame = int(path.shown[len(path.shown) // 2])
    answer = localized(misplaced(path, frame, 150))
    assert answer.trajectory.status[frame] == "rejected"
    assert not answer.is_ambiguous[frame]
    assert np.isnan(answer.rms_px[frame])
    assert errors_of(answer, path)[0].max() < 0.15  # and it did its neighbours no harm
    assert "contradict" in answer.notes[-1]


def seeing_three_tags(count: int = 12) -> RigidTransform:
    """Cameras in one corner of the room that see tags 0, 2 and 5 at once."""
    forward = np.array([-np.cos(np.radians(36)), 0, -np.sin(np.radians(36))])
    axes = np.column_stack([np.cross([0, -1.0, 0], forward), [0, -1.0, 0], forward])
    centres = np.column_stack([2.2 - 0.01 * np.arange(count), np.full(count, 0.2), np.full(count, 1.2)])
    return RigidTransform.from_components(centres, Rotation.from_matrix(np.tile(axes, (count, 1, 1))))


def test_a_tag_that_was_moved_is_found_and_named():
    poses = seeing_three_tags()
    stamps = START_NS + np.arange(len(poses)) * 33_000_000
    where = TAGS.corners.copy()
    where[2] += [0.25, 0.1, 0]
    moved = TagCorners(TAGS.tag_id, where, TAGS.sightings, TAGS.spread)
    sightings = see(poses)
    assert set(sightings.tag_id.tolist()) >= {0, 2, 5}
    path = Walk(stamps, poses, sightings)
    answer = localized(path, corners=moved)
    assert answer.trajectory.has_pose.all()
    assert errors_of(answer, path)[0].max() < 0.05
    assert any(note.startswith("Tag 2 contradicts") for note in answer.notes)
    sees_it = np.isin(np.arange(len(poses)), sightings.frame_index[sightings.tag_id == 2])
    assert answer.disagreement_m[sees_it].min() > 0.1
    assert (answer.tags_used[sees_it] < np.bincount(sightings.frame_index, minlength=len(poses))[sees_it]).all()


def facing_tag(distance_m: float, tilt_deg: float, count: int = 1, step_deg: float = 0.0) -> RigidTransform:
    """Cameras at this distance from tag 2 (on the wall z = -2), `tilt_deg` beside its normal; x right, y down."""
    centre, poses = TAGS.centers[2], []
    for k in range(count):
        beside = np.radians(tilt_deg + k * step_deg)
        out = np.array([np.sin(beside), 0, np.cos(beside)])
        axes = np.column_stack([np.cross([0, -1.0, 0], -out), [0, -1.0, 0], -out])
        poses.append(RigidTransform.from_components(centre + distance_m * out, Rotation.from_matrix(axes)))
    return RigidTransform.concatenate(poses)


def seen_from(poses: RigidTransform, noise_px: float, seed: int) -> Walk:
    """The walk of these poses, tag 2 the only one in the room."""
    alone = TagCorners(TAGS.tag_id[2:3], TAGS.corners[2:3], TAGS.sightings[2:3], TAGS.spread[2:3])
    sightings = see(poses, noise_px, seed=seed, tags=alone)
    return Walk(START_NS + np.arange(len(poses)) * 33_000_000, poses, sightings)


@pytest.mark.parametrize("seed", range(4))
def test_a_lone_small_frontal_tag_is_ambiguous_and_rejected(seed):
    path = seen_from(facing_tag(3.5, 12), 0.3, seed)
    assert path.sightings.tag_id.tolist() == [2]
    answer = localized(path)
    assert answer.trajectory.status.tolist() == ["rejected"]
    assert answer.is_ambiguous.tolist() == [True]
    assert "two poses fit equally well" in answer.notes[-1]


@pytest.mark.parametrize("seed", range(4))
def test_a_clear_view_resolves_the_unclear_ones_around_it(seed):
    clear = facing_tag(2.6, 50, count=10)
    unclear = facing_tag(2.6, 50, count=40, step_deg=-1.0)  # it walks on to where the tag is seen nearly frontal
    path = seen_from(RigidTransform.concatenate([clear, unclear]), 0.3, seed)
    answer = localized(path)
    lone = [
        localized(Walk(path.timestamp_ns, path.truth, pick(path.sightings, path.sightings.frame_index == k)))
        for k in range(35, 50)
    ]
    assert sum(one.is_ambiguous.any() for one in lone) > len(lone) / 2
    assert answer.is_ambiguous.sum() < 5
    assert errors_of(answer, path)[1].max() < 15


def test_a_wall_in_between_decides_where_the_picture_cannot():
    pose = facing_tag(3.2, -42)  # tag 2 is right of the middle of its wall: the mirrored pose lies outside of the room
    path = seen_from(pose, 0.0, 0)
    blurred = LocalizeTagsOptions(corner_error_px=8.0)
    unaided, aided = localized(path, blurred), localized(path, blurred, raycaster=Raycaster(room_mesh()))
    assert unaided.is_ambiguous.tolist() == [True]
    assert aided.trajectory.status.tolist() == ["tag_only"]
    assert errors_of(aided, path)[0].max() < 0.1


def test_a_turned_room_turns_the_poses_along():
    path = walk(seconds=2, noise_px=0.3)
    turn = RigidTransform.from_components([3.0, -1, 2], Rotation.from_rotvec([0.4, -2.0, 0.9]))
    turned = TagCorners(TAGS.tag_id, turn.apply(TAGS.corners.reshape(-1, 3)), TAGS.sightings, TAGS.spread)
    here, there = localized(path), localized(path, corners=turned)
    assert here.trajectory.status.tolist() == there.trajectory.status.tolist()
    has_pose = here.trajectory.has_pose
    shift_m, turn_deg = errors(there.trajectory.poses(has_pose), turn * here.trajectory.poses(has_pose))
    assert shift_m.max() < 1e-3
    assert turn_deg.max() < 0.02


def test_the_order_of_sightings_and_the_epoch_do_not_matter():
    path = walk(seconds=2, noise_px=0.3)
    order = np.random.default_rng(0).permutation(len(path.sightings))
    shuffled = Walk(path.timestamp_ns - START_NS, path.truth, pick(path.sightings, order))
    first, second = localized(path).trajectory, localized(shuffled).trajectory
    np.testing.assert_allclose(first.centers, second.centers, atol=1e-6)


def test_a_long_gap_ties_nothing_together():
    path = walk(seconds=2, noise_px=0.3)
    shown = path.shown
    half = shown[: len(shown) // 2]
    late = path.timestamp_ns.copy()
    late[half[-1] + 1 :] += 60_000_000_000
    whole = localized(Walk(late, path.truth, path.sightings)).trajectory
    first = localized(Walk(late, path.truth, pick(path.sightings, path.sightings.frame_index <= half[-1]))).trajectory
    np.testing.assert_allclose(whole.centers[half], first.centers[half], atol=0.01)


@pytest.mark.parametrize(
    ("frame", "keyframe", "sentence"), [(9, 0, "seen in frame 9"), (0, 7, "keyframes name frame 7")]
)
def test_sightings_and_keyframes_of_another_recording_are_refused(frame, keyframe, sentence):
    one = TagSightings(np.array([frame]), np.array([0]), np.zeros((1, 4, 2)), np.ones(1))
    with pytest.raises(GeometryError, match=sentence):
        localize_tags(START_NS + np.arange(5), np.array([keyframe]), PINHOLE, one, TAGS)


def test_columns_of_another_length_are_refused():
    answer = localized(walk(seconds=0.1))
    with pytest.raises(GeometryError, match="rows of rms_px"):
        TagLocalization(
            answer.trajectory, (), answer.tags_used, np.zeros(7), answer.disagreement_m, answer.is_ambiguous
        )


def test_cancelling_stops_it():
    class Stop(Exception):
        pass

    def stop(fraction: float, text: str = "", /) -> None:
        raise Stop

    with pytest.raises(Stop):
        localized(walk(seconds=0.1), report=stop)
