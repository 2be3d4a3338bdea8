"""Frames are registered, interpolated or have no pose; nothing in between, nothing invented."""

import numpy as np
import pytest
from box_room import make_room
from scipy.spatial.transform import Rotation

from gazeloc_core.errors import GeometryError
from gazeloc_core.localize.sfm import LocalizeSfmOptions, localize_sfm, within_gaps
from gazeloc_core.sfm_model import PlacedModel, TrackedFrames
from gazeloc_core.transforms import Similarity, rotation_angle_rad, wxyz_of

START_NS = 1_700_000_000_123_456_789


def model_of(frame_indices):
    """A model whose images are of these frames, in this order, and the truth of all frames."""
    room = make_room(points=300, images=len(frame_indices))
    return room, type(room.model)(**{**room.model.__dict__, "frame_indices": np.array(frame_indices)})


def times(count: int, step_s: float = 0.1):
    return START_NS + np.round(np.arange(count) * step_s * 1e9).astype(np.int64)


def test_every_frame_has_a_row_and_its_true_status():
    room, model = model_of([2, 5, 20, -1])
    # 0, 1 before the first; 3, 4 between neighbours 0.3 s apart; 8 in a gap of 1.5 s; 4 a keyframe that failed.
    trajectory = localize_sfm(times(24), np.array([2, 4, 5, 20]), [PlacedModel(model, room.scan_from_sfm)])
    expected = ["none"] * 24
    for index, status in {2: "registered", 3: "interpolated", 4: "none", 5: "registered", 20: "registered"}.items():
        expected[index] = status
    assert trajectory.status.tolist() == expected
    assert np.flatnonzero(trajectory.is_keyframe).tolist() == [2, 4, 5, 20]


def test_registered_poses_are_those_of_the_images_whatever_their_order():
    room, model = model_of([7, 0, 3])
    trajectory = localize_sfm(times(8), np.array([0, 3, 7]), [PlacedModel(model, room.scan_from_sfm)])
    for image, frame in enumerate([7, 0, 3]):
        pose, truth = trajectory.pose(frame), room.scan_from_camera[image]
        assert pose is not None
        np.testing.assert_allclose(pose.as_matrix(), truth.as_matrix(), atol=1e-9)


def test_interpolated_poses_lie_between_their_neighbours_in_time():
    room, model = model_of([0, 4])
    stamps = np.array([0, 100, 250, 300, 400], np.int64) * 1_000_000 + START_NS
    trajectory = localize_sfm(stamps, np.array([0, 4]), [PlacedModel(model, room.scan_from_sfm)])
    first, last = (trajectory.pose(i) for i in (0, 4))
    whole = rotation_angle_rad(first.rotation, last.rotation)
    for index, share in ((1, 0.25), (2, 0.625), (3, 0.75)):
        pose = trajectory.pose(index)
        expected = (1 - share) * first.translation + share * last.translation
        np.testing.assert_allclose(pose.translation, expected, atol=1e-9)
        assert rotation_angle_rad(first.rotation, pose.rotation) == pytest.approx(share * whole, rel=1e-6)


def test_a_longer_gap_may_be_allowed():
    room, model = model_of([0, 15])
    arguments = (times(16), np.array([0, 15]), [PlacedModel(model, room.scan_from_sfm)])
    assert localize_sfm(*arguments).has_pose.sum() == 2
    assert localize_sfm(*arguments, LocalizeSfmOptions(max_gap_s=1.5)).has_pose.all()


def test_no_registered_image_gives_no_pose():
    room, model = model_of([-1, -1])
    assert not localize_sfm(times(5), np.array([0, 4]), [PlacedModel(model, room.scan_from_sfm)]).has_pose.any()


@pytest.mark.parametrize(
    ("frames", "keyframes", "sentence"),
    [
        ([0, 9], [0], "name frame 9"),
        ([0, 1], [-2, 1], "keyframes name frame -2"),
        ([1, 1], [0], "frame 1 twice"),
        ([0, 1], [7], "keyframes name frame 7"),
    ],
)
def test_a_model_of_another_recording_is_refused(frames, keyframes, sentence):
    room, model = model_of(frames)
    with pytest.raises(GeometryError, match=sentence):
        localize_sfm(times(5), np.array(keyframes), [PlacedModel(model, room.scan_from_sfm)])


def test_within_gaps_agrees_with_its_definition():
    rng = np.random.default_rng(0)
    for _ in range(200):
        known = np.unique(rng.integers(0, 50, rng.integers(0, 8)))
        at = rng.integers(-5, 55, 20)
        expected = []
        for t in at:
            before, after = known[known <= t], known[known >= t]
            ok = len(before) and len(after) and after.min() - before.max() <= 10
            expected.append(bool(ok))
        assert within_gaps(at, known, 10 / 1e9).tolist() == expected


def test_poses_do_not_depend_on_the_epoch():
    room, model = model_of([0, 4])
    early = localize_sfm(times(5) - START_NS, np.array([0, 4]), [PlacedModel(model, room.scan_from_sfm)])
    late = localize_sfm(times(5), np.array([0, 4]), [PlacedModel(model, room.scan_from_sfm)])
    np.testing.assert_array_equal(early.centers, late.centers)


def test_a_frame_in_two_pieces_takes_its_pose_from_the_larger_one():
    room, model = model_of([0, 3, 6])
    _, other = model_of([6, 9])
    elsewhere = Similarity(1.0, Rotation.identity(), np.array([5.0, 0.0, 0.0])) * room.scan_from_sfm
    pieces = [PlacedModel(model, room.scan_from_sfm), PlacedModel(other, elsewhere)]
    trajectory = localize_sfm(times(10), np.array([0, 3, 6, 9]), pieces)
    np.testing.assert_allclose(trajectory.pose(6).translation, room.scan_from_camera[2].translation, atol=1e-9)
    np.testing.assert_allclose(
        trajectory.pose(9).translation, elsewhere.compose_pose(other.sfm_from_camera[1]).translation, atol=1e-9
    )


def test_nothing_is_interpolated_from_one_piece_to_another():
    room, model = model_of([0, 2])
    _, other = model_of([4, 6])
    pieces = [PlacedModel(model, room.scan_from_sfm), PlacedModel(other, room.scan_from_sfm)]
    trajectory = localize_sfm(times(7), np.array([0, 2, 4, 6]), pieces)
    expected = ["registered", "interpolated", "registered", "none", "registered", "interpolated", "registered"]
    assert trajectory.status.tolist() == expected


def test_no_piece_with_a_place_gives_no_pose():
    assert not localize_sfm(times(5), np.array([0, 4]), []).has_pose.any()


def tracked_frames(frames, poses):
    return TrackedFrames(
        frame_indices=np.array(frames),
        centers=poses.translation,
        wxyz=wxyz_of(poses.rotation),
        points=np.full(len(frames), 99),
        error_px=np.full(len(frames), 0.4),
    )


def test_tracked_frames_keep_their_own_pose_and_say_so():
    room, model = model_of([0, 6])
    elsewhere = model_of([9, 9])[1].sfm_from_camera  # no line between its neighbours leads through these
    piece = PlacedModel(model, room.scan_from_sfm, tracked_frames([2, 6], elsewhere))
    trajectory = localize_sfm(times(9), np.array([0, 6]), [piece])
    expected = ["registered", "interpolated", "tracked", *["interpolated"] * 3, "registered", "none", "none"]
    assert trajectory.status.tolist() == expected  # frame 6 has an image: that goes first
    pose = room.scan_from_sfm.compose_pose(elsewhere[0])
    np.testing.assert_allclose(trajectory.pose(2).as_matrix(), pose.as_matrix(), atol=1e-9)
    assert trajectory.counts()["tracked"] == 1
    assert trajectory.is_localised.sum() == 3


def test_a_keyframe_that_was_not_registered_may_be_tracked():
    room, model = model_of([0, 4])
    piece = PlacedModel(model, room.scan_from_sfm, tracked_frames([2], model.sfm_from_camera[:1]))
    trajectory = localize_sfm(times(5), np.array([0, 2, 3, 4]), [piece])
    assert trajectory.status.tolist() == ["registered", "interpolated", "tracked", "none", "registered"]


def test_no_tracked_frame_is_as_if_nothing_was_tracked():
    room, model = model_of([0, 4])
    nothing = tracked_frames([], model.sfm_from_camera[:0])
    arguments = (times(5), np.array([0, 4]))
    with_none = localize_sfm(*arguments, [PlacedModel(model, room.scan_from_sfm, nothing)])
    without = localize_sfm(*arguments, [PlacedModel(model, room.scan_from_sfm)])
    np.testing.assert_array_equal(with_none.centers, without.centers)


def test_tracked_frames_of_another_recording_are_refused():
    room, model = model_of([0, 4])
    piece = PlacedModel(model, room.scan_from_sfm, tracked_frames([7], model.sfm_from_camera[:1]))
    with pytest.raises(GeometryError, match="tracked frames name frame 7"):
        localize_sfm(times(5), np.array([0, 4]), [piece])
