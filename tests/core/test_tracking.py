"""Frames between images are measured, or say that they were not: laws on a room whose every pose is known."""

from dataclasses import replace

import numpy as np
import pytest
from painted_room import LENS, SFM_FROM_ROOM, Pictures, head_poses, model_of, picture, recording_of
from scipy.spatial.transform import RigidTransform, Rotation

from gazeloc_core.errors import Cancelled
from gazeloc_core.localize.frame_pose import FramePose
from gazeloc_core.localize.sfm import localize_sfm
from gazeloc_core.localize.stretches import stretches
from gazeloc_core.localize.track_evidence import EvidenceOptions, KnownPose, Refusal, refusal
from gazeloc_core.localize.track_points import spread
from gazeloc_core.localize.tracking import TrackingOptions, joined, track_frames, track_stretches
from gazeloc_core.sfm_model import PlacedModel
from gazeloc_core.transforms import rotation_angle_rad

COUNT = 40
IMAGES = [5, 15, 25, 34]
# Pictures have 320 x 300 pixels of a quarter of a degree, and points drift the further they are carried.
BETWEEN_DEG, BETWEEN_M = 0.12, 0.004
ONE_SIDED_DEG, ONE_SIDED_M = 0.4, 0.012


@pytest.fixture(scope="module")
def walk():
    """True poses in the room, what was tracked, and the frames that were read."""
    poses = head_poses(COUNT)
    frames = Pictures(poses)
    recording = recording_of(frames)
    tracking = track_frames(model_of(poses, IMAGES), recording, taken(IMAGES))
    return poses, tracking, frames.read_frames


def taken(images, count=COUNT):
    mask = np.zeros(count, bool)
    mask[images] = True
    return mask


def track(frames, images, **options):
    recording = recording_of(frames)
    model = model_of(frames.poses, images)
    return track_frames(model, recording, taken(images, len(frames)), TrackingOptions(**options))


def errors(tracked, poses):
    """Errors in degrees and metres of tracked frames, brought back into the room."""
    found = SFM_FROM_ROOM.inverse().compose_pose(tracked.sfm_from_camera)
    truth = poses[tracked.frame_indices]
    return (
        np.degrees(rotation_angle_rad(found.rotation, truth.rotation)),
        np.linalg.norm(found.translation - truth.translation, axis=1),
    )


def test_every_frame_between_images_and_beside_them_has_its_true_pose(walk):
    poses, tracking, _ = walk
    assert tracking.tracked.frame_indices.tolist() == [i for i in range(COUNT) if i not in IMAGES]
    rotation_deg, position_m = errors(tracking.tracked, poses)
    between = (tracking.tracked.frame_indices > IMAGES[0]) & (tracking.tracked.frame_indices < IMAGES[-1])
    assert rotation_deg[between].max() < BETWEEN_DEG
    assert position_m[between].max() < BETWEEN_M
    assert rotation_deg.max() < ONE_SIDED_DEG
    assert position_m.max() < ONE_SIDED_M


def test_tracked_poses_are_far_better_than_interpolated_ones(walk):
    poses, tracking, _ = walk
    model = model_of(poses, IMAGES)
    times = recording_of(Pictures(poses)).timestamp_ns
    placed = [PlacedModel(model, SFM_FROM_ROOM.inverse())]
    between = np.setdiff1d(np.arange(IMAGES[0], IMAGES[-1]), IMAGES)
    before = localize_sfm(times, np.array(IMAGES), placed).poses(between)
    interpolated_deg = np.degrees(rotation_angle_rad(before.rotation, poses[between].rotation))
    rotation_deg, _ = errors(tracking.tracked, poses)
    assert np.median(interpolated_deg) > 8 * np.median(rotation_deg)


def test_each_frame_is_decoded_once_and_in_order(walk):
    _, _, read = walk
    assert read == list(range(COUNT))


def test_evidence_is_kept_with_each_frame(walk):
    _, tracking, _ = walk
    assert tracking.tried == len(tracking.tracked)
    assert not tracking.refused
    assert (tracking.tracked.points >= EvidenceOptions().least_points).all()
    assert (tracking.tracked.error_px < 1).all()


def test_a_frame_without_texture_is_not_tracked_and_its_neighbours_are():
    poses = head_poses(21)
    blank = np.full((LENS.height, LENS.width, 3), 90, np.uint8)
    tracking = track(Pictures(poses, {8: blank}), [0, 20])
    assert 8 not in tracking.tracked.frame_indices
    # Carried from one side only: beyond the blank frame the points of that side are lost.
    assert {7, 9} <= set(tracking.tracked.frame_indices.tolist())
    rotation_deg, _ = errors(tracking.tracked, poses)
    assert rotation_deg.max() < ONE_SIDED_DEG
    assert sum(tracking.refused.values()) == tracking.tried - len(tracking.tracked) == 1


def test_a_frame_of_another_place_is_refused():
    poses = head_poses(21)
    elsewhere = picture(RigidTransform.from_components([1.0, 0.0, 0.5], Rotation.from_rotvec([0, 2.5, 0])))
    tracking = track(Pictures(poses, {12: elsewhere}), [0, 20])
    assert 12 not in tracking.tracked.frame_indices
    rotation_deg, _ = errors(tracking.tracked, poses)
    assert rotation_deg.max() < ONE_SIDED_DEG


def test_beyond_the_last_image_the_first_refusal_ends_it():
    poses = head_poses(20)
    blank = np.full((LENS.height, LENS.width, 3), 90, np.uint8)
    tracking = track(Pictures(poses, {14: blank}), [2, 9])
    assert tracking.tracked.frame_indices.max() == 13


def test_points_reach_no_further_than_they_are_told():
    poses = head_poses(30)
    tracking = track(Pictures(poses), [10], most_frames=4)
    assert tracking.tracked.frame_indices.tolist() == [6, 7, 8, 9, 11, 12, 13, 14]


def test_a_model_without_observations_tracks_nothing():
    poses = head_poses(6)
    model = model_of(poses, [0, 5])
    nothing = np.zeros(0, int)
    bare = replace(model, observation_point=nothing, observation_image=nothing, observation_px=np.zeros((0, 2)))
    tracking = track_frames(bare, recording_of(Pictures(poses)), taken([0, 5], 6))
    assert len(tracking.tracked) == 0
    assert tracking.refused == {Refusal.LOST: 4}


@pytest.mark.parametrize("frames_of_images", [[0, 1, 2, 3], [-1, -1, -1, -1]])
def test_where_there_is_nothing_between_nothing_is_read(frames_of_images):
    poses = head_poses(4)
    frames = Pictures(poses)
    model = replace(model_of(poses, [0, 1, 2, 3]), frame_indices=np.array(frames_of_images))
    tracking = track_frames(model, recording_of(frames), np.isin(np.arange(4), frames_of_images))
    assert tracking.tried == len(tracking.tracked) == 0
    assert not frames.read_frames


def test_stretches_are_tracked_one_by_one_and_some_may_be_left_out(walk):
    poses, tracking, _ = walk
    frames = Pictures(poses)
    rest = joined(track_stretches(model_of(poses, IMAGES), recording_of(frames), taken(IMAGES), skip=3))
    later = tracking.tracked.frame_indices > IMAGES[2]
    np.testing.assert_array_equal(rest.tracked.centers, tracking.tracked.centers[later])
    assert min(frames.read_frames) == IMAGES[2]


def test_it_can_be_cancelled_at_any_frame():
    poses = head_poses(12)

    def cancel(fraction: float, text: str = "", /) -> None:
        if fraction > 0.4:
            raise Cancelled

    with pytest.raises(Cancelled):
        track_frames(model_of(poses, [0, 11]), recording_of(Pictures(poses)), taken([0, 11], 12), report=cancel)


def test_the_same_frames_give_the_same_poses(walk):
    poses, tracking, _ = walk
    again = track(Pictures(poses), IMAGES)
    np.testing.assert_array_equal(again.tracked.centers, tracking.tracked.centers)


def frame_found(turned_deg=0.0, moved=0.0, agreeing=100, wide=True):
    """A pose turned and moved off the identity, with points 3 m ahead, and where they are seen."""
    rng = np.random.default_rng(0)
    high = (LENS.width, LENS.height) if wide else (60, 60)
    pixels = rng.uniform((0, 0), high, (120, 2))
    pose = RigidTransform.from_components([moved, 0, 0], Rotation.from_rotvec([0, np.radians(turned_deg), 0]))
    points = pose.apply(3.0 * LENS.unproject(pixels))
    return FramePose(pose, np.arange(120) < agreeing, np.full(120, 0.3)), pixels, points


@pytest.mark.parametrize(
    ("found", "why"),
    [
        (frame_found(), None),
        (frame_found(turned_deg=15), None),
        (frame_found(turned_deg=40), Refusal.LEAP),
        (frame_found(moved=0.2), None),
        (frame_found(moved=0.5), Refusal.LEAP),
        (frame_found(agreeing=24), Refusal.FEW),
        (frame_found(agreeing=48), Refusal.FEW),
        (frame_found(agreeing=52), None),  # less than half, but 26 from either side
        (frame_found(wide=False), Refusal.ONE_PLACE),
    ],
)
def test_what_is_refused(found, why):
    """50 ms after a known pose: a head turns 30 degrees at most, and moves a tenth of the distance to what it sees."""
    known = [KnownPose(RigidTransform.identity(), 0.05)]
    is_from_before = np.arange(120) % 2 == 0
    assert refusal(found[0], LENS, found[1], found[2], is_from_before, known, EvidenceOptions()) is why


def test_points_of_one_side_are_enough_where_the_other_side_went_astray():
    found, pixels, points = frame_found(agreeing=45)
    is_from_before = np.arange(120) < 50
    assert refusal(found, LENS, pixels, points, is_from_before, [], EvidenceOptions()) is None


def test_stretches_cover_every_frame_within_reach_once():
    times = np.arange(100, dtype=np.int64) * 10**8
    is_taken = taken([10, 14, 60, 20], 100)
    found = list(stretches(np.array([10, 14, 60]), is_taken, times, 1.0, 8))
    assert [(s.before, s.after) for s in found] == [(None, 10), (10, 14), (14, 60), (60, None)]
    assert [s.frames for s in found] == [
        list(range(2, 10)),
        [11, 12, 13],
        [*range(15, 20), *range(52, 60)],  # frame 20 is another piece's: nothing is carried over it
        list(range(61, 69)),
    ]
    assert list(found[1].from_after) == [13, 12, 11]
    assert found[2].needed == [14, *range(15, 20), *range(52, 61)]


def test_spread_takes_the_best_of_every_place_first():
    rng = np.random.default_rng(1)
    crowd = np.concatenate([rng.uniform(0, 0.1, (500, 2)), rng.uniform(0, 1, (60, 2))])
    worth = rng.integers(2, 9, 560)
    chosen = spread(crowd, worth, 50)
    assert len(chosen) == 50 == len(np.unique(chosen))
    assert (chosen >= 500).sum() >= 30  # the crowd does not crowd the others out
    assert (worth[chosen[chosen < 500]] == worth.max()).all()
    assert spread(crowd[:5], worth[:5], 50).tolist() == [0, 1, 2, 3, 4]
