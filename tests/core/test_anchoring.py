"""A reconstruction bent to tags: on a long chain of short tracks, which drifts, and on one that has no need of it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from gazeloc_core.alignment.similarity_fit import fit_similarity
from gazeloc_core.bending.anchored_bundle import AnchorOptions, Anchors, anchor
from gazeloc_core.bending.anchoring import AnchoringOptions, bend_to_tags
from gazeloc_core.camera import Camera
from gazeloc_core.errors import Cancelled
from gazeloc_core.sfm_model import SfmModel
from gazeloc_core.tag_types import TagCorners, TagSightings
from gazeloc_core.transforms import Similarity

CAMERA = Camera.pinhole(1000, 900, 700, 720, 490, 460)
IMAGES, TAGS, TAG_M = 40, 6, 0.16
SCAN_FROM_SFM = Similarity(2.5, Rotation.from_rotvec([0.3, -0.8, 0.2]), np.array([1.0, 2.0, -0.5]))


def walk() -> RigidTransform:
    """Cameras in sfm that go along a wall and turn with it."""
    along = np.linspace(0, 1, IMAGES)
    turn = Rotation.from_euler("y", (120 * along - 60)[:, None], degrees=True)
    return RigidTransform.from_components(np.column_stack([4 * along, 0.1 * np.sin(9 * along), 0 * along]), turn)


def wall(rng: np.random.Generator, poses: RigidTransform, views: int, points: int) -> tuple[np.ndarray, np.ndarray]:
    """Points (P, 3), and the images (P, views) that follow each other and see them."""
    first = rng.integers(0, IMAGES - views + 1, points)
    middle = poses[first + views // 2]
    rays = CAMERA.unproject(rng.uniform([350, 250], [650, 650], (points, 2)))
    return middle.apply(rays * rng.uniform(1.0, 2.2, (points, 1))), first[:, None] + np.arange(views)


def tag_corners(rng: np.random.Generator, poses: RigidTransform) -> np.ndarray:
    """Corners (T, 4, 3) in sfm of tags spread along the walk."""
    square = np.array([[-1, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]]) * TAG_M / 2 / SCAN_FROM_SFM.scale
    at = np.linspace(2, IMAGES - 3, TAGS).astype(int)
    return np.array([poses[i].apply(square + np.append(rng.uniform(-0.2, 0.2, 2), 1.4)) for i in at.tolist()])


class Room:
    """The truth, the tags, and a model that is the best fit to its own noisy observations."""

    def __init__(self, views: int, noise_px: float, points: int = 900, tag_error_m: float = 0.004):
        rng = np.random.default_rng(views)
        self.true = walk()
        places, images = wall(rng, self.true, views, points)
        image, point = images.ravel(), np.repeat(np.arange(points), views)
        px = self._seen(image, places[point]) + rng.normal(0, noise_px, (len(point), 2))
        self.truth = truth = SfmModel(
            {1: CAMERA},
            tuple(f"{i}.jpg" for i in range(IMAGES)),
            np.ones(IMAGES),
            self.true,
            np.arange(IMAGES),
            places,
            np.zeros((points, 3)),
            np.ones(points),
            np.full(points, views),
            point,
            image,
            px,
        )
        self.corners = tag_corners(rng, self.true)
        self.sightings = self._sightings(rng)
        on_scan = SCAN_FROM_SFM.apply(self.corners.reshape(-1, 3)).reshape(-1, 4, 3)
        on_scan = on_scan + rng.normal(0, tag_error_m, (TAGS, 1, 3))
        self.on_scan = TagCorners(np.arange(TAGS), on_scan, np.full(TAGS, 9), np.full(TAGS, 0.004))
        free = anchor(truth, self.anchors(np.inf))
        self.model, found = free.model, free.points.reshape(-1, 4, 3)
        self.in_sfm = TagCorners(np.arange(TAGS), found, np.full(TAGS, 9), np.full(TAGS, 0.004))

    def _seen(self, image: np.ndarray, places: np.ndarray) -> np.ndarray:
        return CAMERA.project(self.true[image].inv().apply(places))

    def _sightings(self, rng: np.random.Generator) -> TagSightings:
        rows = []
        for tag, corners in enumerate(self.corners):
            for image in range(IMAGES):
                if (self.true[image].inv().apply(corners)[:, 2] > 0.3).all():
                    px = self._seen(np.full(4, image), corners)
                    if CAMERA.contains(px).all():
                        rows.append((image, tag, px + rng.normal(0, 0.4, (4, 2))))
        frames, tags, corners_px = zip(*rows, strict=True)
        return TagSightings(np.array(frames), np.array(tags), np.array(corners_px), np.full(len(rows), 50.0))

    def anchors(self, sigma: float) -> Anchors:
        seen = self.sightings
        return Anchors(
            self.corners.reshape(-1, 3),
            np.full(4 * TAGS, sigma),
            np.repeat(np.arange(TAGS), 4),
            (4 * seen.tag_id[:, None] + np.arange(4)).ravel(),
            np.repeat(seen.frame_index, 4),
            seen.corners_px.reshape(-1, 2),
        )

    def error_m(self, model: SfmModel, in_sfm: np.ndarray) -> float:
        """Mean distance of the cameras from the truth, aligned by the tags at (T, 4, 3)."""
        fit = fit_similarity(in_sfm.reshape(-1, 3), self.on_scan.corners.reshape(-1, 3))
        true = SCAN_FROM_SFM.apply(np.asarray(self.true.translation))
        return float(np.linalg.norm(fit.apply(np.asarray(model.sfm_from_camera.translation)) - true, axis=1).mean())


@pytest.fixture(scope="module")
def drifting() -> Room:
    return Room(views=3, noise_px=1.2, points=500)


@pytest.fixture(scope="module")
def rigid() -> Room:
    return Room(views=12, noise_px=0.3)


def bend(room: Room, **options: object):
    return bend_to_tags(room.model, room.sightings, room.on_scan, room.in_sfm, AnchoringOptions(**options))


def test_exact_observations_and_anchors_bring_a_disturbed_model_back_to_the_truth():
    room = Room(views=6, noise_px=0.0, tag_error_m=0.0)
    rng = np.random.default_rng(0)
    turns = Rotation.from_rotvec(rng.normal(0, 0.004, (IMAGES, 3)))
    disturbed = replace(
        room.truth,
        sfm_from_camera=RigidTransform.from_components(
            np.asarray(room.true.translation) + rng.normal(0, 0.01, (IMAGES, 3)), room.true.rotation * turns
        ),
        points=room.truth.points + rng.normal(0, 0.01, room.truth.points.shape),
    )
    seen = room.sightings
    exact = replace(room.anchors(0.001), px=room._seen(np.repeat(seen.frame_index, 4), _corners_seen(room)))
    found = anchor(disturbed, exact)
    assert found.cost_after < 1e-3 * found.cost_before
    assert np.allclose(found.model.sfm_from_camera.translation, room.true.translation, atol=1e-4)
    assert np.allclose(found.model.points, room.truth.points, atol=1e-3)


def _corners_seen(room: Room) -> np.ndarray:
    return room.corners[room.sightings.tag_id].reshape(-1, 3)


def test_a_chain_that_drifts_is_bent_and_comes_nearer_to_the_truth(drifting: Room):
    before = drifting.error_m(drifting.model, drifting.in_sfm.corners)
    found = bend(drifting)
    assert found.is_accepted, found.reason
    assert found.left_out_after_m < found.left_out_before_m
    after = anchor(drifting.model, _sigma_of_scan(drifting)).points.reshape(-1, 4, 3)
    assert drifting.error_m(found.model, after) < 0.75 * before
    assert found.reason.startswith("Bent to the tags: tags left out in turn are off by")


def _sigma_of_scan(room: Room) -> Anchors:
    """The anchors as the scan has them, in sfm."""
    places = SCAN_FROM_SFM.inverse().apply(room.on_scan.corners.reshape(-1, 3))
    return replace(room.anchors(0.011 / SCAN_FROM_SFM.scale), points=places)


def test_a_rigid_reconstruction_is_hardly_moved_by_the_tags_own_errors(rigid: Room):
    before = rigid.error_m(rigid.model, rigid.in_sfm.corners)
    bent = anchor(rigid.model, _sigma_of_scan(rigid))
    assert rigid.error_m(bent.model, bent.points.reshape(-1, 4, 3)) < before + 0.002
    found = bend(rigid)
    assert found.left_out_before_m < 0.02
    if not found.is_accepted:
        assert found.model is rigid.model
        assert found.reason.startswith("Not bent to the tags, for that proves no better")


def test_a_tag_that_was_moved_between_scan_and_recording_does_not_pull(drifting: Room):
    corners = np.array(drifting.on_scan.corners)
    corners[2] += [0.5, 0.0, 0.3]
    moved = replace(drifting.on_scan, corners=corners)
    found = bend_to_tags(drifting.model, drifting.sightings, moved, drifting.in_sfm)
    bent = anchor(drifting.model, _sigma_of_scan(drifting)).points.reshape(-1, 4, 3)
    limit = drifting.error_m(drifting.model, drifting.in_sfm.corners) + 0.005
    assert drifting.error_m(found.model, bent if found.is_accepted else drifting.in_sfm.corners) < limit


def test_points_that_take_no_part_go_along_with_their_cameras(drifting: Room):
    shift = Similarity(1.0, Rotation.identity(), np.array([0.3, 0.0, 0.0]))
    anchors = _sigma_of_scan(drifting)
    far = replace(anchors, points=shift.apply(anchors.points), sigma=np.full(4 * TAGS, 1e-4))
    some = AnchorOptions(most_observations=600)
    found = anchor(drifting.model, far, some)
    moved = found.model.points - drifting.model.points
    assert np.median(moved[:, 0]) == pytest.approx(0.3, abs=0.05)
    assert (np.linalg.norm(moved, axis=1) > 0.1).mean() > 0.95


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda room: {"on_scan": _first(room.on_scan, 3)}, "3 are on both sides, it takes 4"),
        (lambda room: {"options": AnchoringOptions(most_images=10)}, "it has 40 images, more than 10"),
        (lambda room: {"model": replace(room.model, cameras={1: _bent_lens()})}, "its camera is not a pinhole one"),
    ],
)
def test_what_cannot_be_bent_stays_and_says_why(drifting: Room, change, sentence: str):
    given = {"model": drifting.model, "on_scan": drifting.on_scan, "options": None} | change(drifting)
    found = bend_to_tags(given["model"], drifting.sightings, given["on_scan"], drifting.in_sfm, given["options"])
    assert found.model is given["model"]
    assert not found.is_accepted
    assert found.reason == f"Not bent to the tags: {sentence}."


def _first(tags: TagCorners, count: int) -> TagCorners:
    return TagCorners(tags.tag_id[:count], tags.corners[:count], tags.sightings[:count], tags.spread[:count])


def _bent_lens() -> Camera:
    return Camera.from_opencv(1000, 900, [[700, 0, 490], [0, 720, 460], [0, 0, 1]], [-0.1, 0.05, 0, 0])


def test_a_cancel_comes_through(drifting: Room):
    def report(fraction: float, text: str = "", /) -> None:
        raise Cancelled("Cancelled.")

    with pytest.raises(Cancelled):
        bend_to_tags(drifting.model, drifting.sightings, drifting.on_scan, drifting.in_sfm, report=report)
