"""The parts of the reconstruction that are ours: tag corners as features, bridges, and the last adjustment."""

from pathlib import Path

import cv2
import numpy as np
import pycolmap
from corner_room import CAMERA, write_room
from scipy.spatial.transform import Rotation

from gazeloc_core.sfm.bridges import MoreFrames, frames_in_gaps, spaced
from gazeloc_core.sfm.polish import polish
from gazeloc_core.sfm.reconstruction import SfmOptions, reconstruct
from gazeloc_core.sfm.tags import corner_descriptors, corner_keypoints
from gazeloc_core.tag_types import TagSightings

NO_SIGHTINGS = TagSightings(np.empty(0), np.empty(0), np.empty((0, 4, 2)), np.empty(0))


def test_corners_have_the_same_descriptor_in_every_frame_and_no_two_are_alike() -> None:
    ids = np.arange(60)
    codes = corner_descriptors(ids).astype(float) / 512
    np.testing.assert_array_equal(corner_descriptors(ids[[7, 7]])[:4], corner_descriptors(ids[[7]]))
    np.testing.assert_allclose(np.linalg.norm(codes, axis=1), 1, atol=0.01)  # as long as COLMAP's own
    away = np.linalg.norm(codes[:, None] - codes[None], axis=2)[~np.eye(len(codes), dtype=bool)]
    assert away.min() > 0.7  # the matcher's largest distance


def test_corner_keypoints_keep_their_places_and_order() -> None:
    pixels = np.arange(16.0).reshape(2, 4, 2)
    np.testing.assert_array_equal(corner_keypoints(pixels)[:, :2], pixels.reshape(-1, 2))
    assert corner_keypoints(np.empty((0, 4, 2))).shape == (0, 6)


def test_frames_are_taken_from_weak_gaps_alone() -> None:
    keyframes, matches = np.array([2, 6, 10, 14]), np.array([500, 12, 60])
    assert frames_in_gaps(keyframes, matches, np.arange(20), 60).tolist() == [7, 8, 9]
    assert frames_in_gaps(keyframes, matches, np.arange(20), 61).tolist() == [7, 8, 9, 11, 12, 13]
    assert frames_in_gaps(keyframes, matches, np.array([8, 10, 15]), 60).tolist() == [8]
    assert frames_in_gaps(keyframes, matches, np.arange(20), 0).tolist() == []


def test_frames_are_spaced_by_time_not_by_number() -> None:
    regular = (np.arange(90) / 30 * 1e9).astype(np.int64)
    assert len(spaced(regular, 15.0)) == 45
    assert len(spaced(regular, 60.0)) == 90
    uneven = np.array([0, 10, 20, 500, 510, 1000]) * 1_000_000
    assert spaced(uneven, 10.0).tolist() == [0, 3, 5]


def test_a_broken_chain_is_joined_by_the_frames_between(tmp_path: Path) -> None:
    """Two looks at a room that have nothing in common, and frames of the turn from one to the other."""
    names = write_room(tmp_path, 9)
    asked: list[int] = []

    def write(frames: np.ndarray, folder: Path) -> list[str]:
        asked.extend(frames.tolist())
        for frame in frames:
            cv2.imwrite(str(folder / names[frame]), cv2.imread(str(tmp_path / names[frame])))
        return [names[frame] for frame in frames]

    chosen = [0, 1, 2, 6, 7, 8]
    more = MoreFrames(np.arange(9), write)
    found = [
        reconstruct(
            tmp_path,
            [names[i] for i in chosen],
            CAMERA,
            np.array(chosen),
            tmp_path / "work",
            SfmOptions(weak_link=weak),
            more_frames=more,
        )[0].frame_indices.tolist()
        for weak in (0, 100_000)
    ]
    assert asked == [3, 4, 5]
    assert set(found[0]) <= set(chosen)
    assert found[1] == list(range(9))


def test_tag_corners_become_points_of_the_model(tmp_path: Path) -> None:
    names = write_room(tmp_path)
    frames = np.arange(len(names))
    centres = np.array([[1.2 * i / 7 - 0.6, 0.1 * np.sin(i), 0.0] for i in range(8)])
    turns = [Rotation.from_euler("y", -20 + 40 * i / 7, degrees=True) for i in range(8)]
    square = np.array([[-0.1, 0.1, 2.5], [0.1, 0.1, 2.5], [0.1, -0.1, 2.5], [-0.1, -0.1, 2.5]])
    corners = np.array([CAMERA.project(turn.inv().apply(square - c)) for c, turn in zip(centres, turns, strict=True)])
    sightings = TagSightings(frames, np.full(8, 3), corners, np.full(8, 50.0))
    options = SfmOptions(max_features=1500)
    model = reconstruct(tmp_path, names, CAMERA, frames, tmp_path / "work", options, sightings=sightings)[0]
    for image in range(8):
        mine = model.observation_px[model.observation_image == image]
        away = np.linalg.norm(mine[:, None] - corners[model.frame_indices[image]][None], axis=2).min(axis=0)
        assert away.max() < 1e-3
    none = reconstruct(tmp_path, names, CAMERA, frames, tmp_path / "work", options, sightings=NO_SIGHTINGS)[0]
    assert len(none) == 8


def test_false_matches_of_two_frames_do_not_move_cameras(tmp_path: Path) -> None:
    names = write_room(tmp_path)
    reconstruct(tmp_path, names, CAMERA, np.arange(8), tmp_path / "work")
    folder = tmp_path / "work" / "models" / "0"
    centres = {}
    for least_views, spoilt in ((3, False), (3, True), (2, True)):
        model = pycolmap.Reconstruction(str(folder))
        if spoilt:
            _spoil(model)
        polish(model, least_views)
        placed = [model.find_image_with_name(name).cam_from_world() for name in names]
        centres[least_views, spoilt] = np.array([pose.inverse().translation for pose in placed])
    size = np.linalg.norm(np.ptp(centres[3, False], axis=0))
    moved = {key: np.linalg.norm(value - centres[3, False], axis=1).max() / size for key, value in centres.items()}
    assert moved[3, True] < 0.01
    assert moved[2, True] > 2 * moved[3, True]


def _spoil(model: pycolmap.Reconstruction) -> None:
    """Points of two frames, each a little off in one of them, always to the same side."""
    for point in model.points3D.values():
        elements = point.track.elements
        if len(elements) == 2:
            feature = model.images[elements[0].image_id].points2D[elements[0].point2D_idx]
            feature.xy += np.array([0.0, 2.0])
