"""Pieces of a broken reconstruction are placed by their own tags, or not at all and with a sentence."""

from dataclasses import replace

import numpy as np
import pytest
from box_room import PINHOLE, Room, make_room, true_tag_corners
from fake_project import make_project
from scipy.spatial.transform import Rotation

from gazeloc_core.bending.pieces import Piece, place_pieces
from gazeloc_core.errors import ProjectError
from gazeloc_core.sfm_model import SfmModel
from gazeloc_core.stages import inputs
from gazeloc_core.tag_types import TagCorners, TagSightings
from gazeloc_core.transforms import Similarity

PLACED_M, PLACED_DEG = 0.01, 0.3
"""Corners are seen to 0.3 px and known on the scan exactly; a piece of 20 cameras lies this near to the truth."""


@pytest.fixture(scope="module")
def room() -> Room:
    return make_room(points=300, images=40)


def sightings(room: Room, tags: TagCorners, noise_px: float = 0.3) -> TagSightings:
    """Every tag that a camera of the room has in its picture."""
    rng = np.random.default_rng(5)
    rows = []
    for frame in range(len(room.model)):
        from_scan = room.scan_from_camera[frame].inv()
        for tag, corners in zip(tags.tag_id.tolist(), tags.corners, strict=True):
            local = from_scan.apply(np.array(corners))
            px = PINHOLE.project(local)
            if (local[:, 2] > 0.3).all() and (px > 5).all() and (px < [PINHOLE.width - 5, PINHOLE.height - 5]).all():
                rows.append((frame, tag, px + rng.normal(0, noise_px, (4, 2))))
    frame, tag, px = zip(*rows, strict=True)
    return TagSightings(np.array(frame), np.array(tag), np.array(px), np.full(len(rows), 50.0))


def piece_of(room: Room, images: range, elsewhere: Similarity) -> SfmModel:
    """Some of the room's images as a model with an origin, axes and a scale of its own."""
    model, some = room.model, np.array(images)
    return replace(
        model,
        image_names=tuple(model.image_names[i] for i in some),
        image_camera_ids=model.image_camera_ids[some],
        sfm_from_camera=elsewhere.compose_pose(model.sfm_from_camera[some]),
        frame_indices=model.frame_indices[some],
        points=elsewhere.apply(model.points),
    )


ELSEWHERE = Similarity(4.1, Rotation.from_rotvec([1.0, 0.2, -2.0]), np.array([7.0, 0.0, -3.0]))


def placed(room: Room, piece: SfmModel, seen: TagSightings | None, scan: TagCorners | None) -> Piece:
    (answer,) = place_pieces([piece_of(room, range(40), ELSEWHERE), piece], PINHOLE, seen, scan)
    assert answer.rank == 1
    assert answer.is_placed == (answer.alignment is not None)
    return answer


def test_a_piece_is_placed_by_its_own_tags(room: Room):
    piece = piece_of(room, range(0, 40, 2), ELSEWHERE)
    answer = placed(room, piece, sightings(room, room.scan_tags), room.scan_tags)
    assert answer.alignment is not None
    found = answer.alignment.scan_from_sfm.compose_pose(piece.sfm_from_camera)
    truth = room.scan_from_camera[np.arange(0, 40, 2)]
    assert np.linalg.norm(found.translation - truth.translation, axis=1).max() < PLACED_M
    assert np.degrees((found.rotation.inv() * truth.rotation).magnitude()).max() < PLACED_DEG
    assert answer.reason.startswith("Piece 2 of the reconstruction (20 frames) is aligned by its own tags ")


def test_the_largest_model_is_left_to_the_alignment(room: Room):
    assert place_pieces([room.model], PINHOLE, sightings(room, room.scan_tags), room.scan_tags) == ()


def test_a_piece_without_tags_on_the_scan_has_no_place_and_says_so(room: Room):
    piece = piece_of(room, range(20), ELSEWHERE)
    seen, scan = sightings(room, room.scan_tags), room.scan_tags
    other = TagCorners(scan.tag_id + 100, scan.corners, scan.sightings, scan.spread)
    assert "determines no tag that is on the scan" in placed(room, piece, seen, other).reason
    assert "cannot be placed without tags" in placed(room, piece, None, scan).reason
    assert "cannot be placed without tags" in placed(room, piece, seen, None).reason


def test_a_piece_whose_tags_contradict_the_scan_has_no_place(room: Room):
    piece = piece_of(room, range(40), ELSEWHERE)
    true = true_tag_corners()
    shuffled = TagCorners(true.tag_id, true.corners[[3, 0, 4, 1, 5, 2]], true.sightings, true.spread)
    answer = placed(room, piece, sightings(room, room.scan_tags), shuffled)
    assert answer.alignment is None
    assert "tags 0, 1, 2, 3, 5, but its alignment is not to be trusted" in answer.reason


def test_a_single_far_tag_does_not_place_a_piece(room: Room):
    """Its corners leave the rotation open to degrees: the evidence says so, whatever the residuals are."""
    seen = sightings(room, room.scan_tags, noise_px=1.0)
    tag = int(np.bincount(seen.tag_id).argmax())
    rough = np.array(room.scan_tags.spread) + 0.03
    scan = TagCorners(room.scan_tags.tag_id, room.scan_tags.corners, room.scan_tags.sightings, rough)
    row = np.flatnonzero(scan.tag_id == tag)
    alone = TagCorners(scan.tag_id[row], scan.corners[row], scan.sightings[row], scan.spread[row])
    answer = placed(room, piece_of(room, range(40), ELSEWHERE), seen, alone)
    assert answer.alignment is None
    assert f"shows tag {tag}, but its alignment is not to be trusted" in answer.reason


def test_a_piece_that_an_earlier_reconstruction_had_is_a_sentence(tmp_path):
    project = make_project(tmp_path)
    assert len(inputs.load_sfm_model(project, "walk")) > 0
    with pytest.raises(ProjectError, match="walk: the reconstruction has no piece 3 any more"):
        inputs.load_sfm_model(project, "walk", rank=2)
