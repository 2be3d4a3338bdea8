"""The paper's tag centres: rays on the scan, clusters of points in the reconstruction."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from box_room import GLASSES, PINHOLE, SFM_FROM_SCAN, TAGS, make_room, room_mesh, true_tag_corners
from scipy.spatial.transform import RigidTransform, Rotation
from sighted_room import looking_at

from gazeloc_core.alignment.paper_keypoints import (
    SfmTagCenterOptions,
    TagCenters,
    center_pairs,
    scan_tag_centers,
    scene_size,
    sfm_tag_centers,
)
from gazeloc_core.camera import Camera
from gazeloc_core.errors import GeometryError, InputError
from gazeloc_core.scan import Mesh, RoomScan, ScanFrame
from gazeloc_core.surfaces.raycast import Raycaster
from gazeloc_core.tag_types import TagSightings
from gazeloc_core.transforms import Similarity

CORNERS = true_tag_corners()


def stands_before(tag: int, sideways_m: float = 0.6, away_m: float = 0.7) -> RigidTransform:
    centre, outward, right = (np.array(v, float) for v in TAGS[tag])
    return looking_at(centre, centre + away_m * outward + sideways_m * right)


def sightings_of(seen: list[tuple[int, int, np.ndarray]]) -> TagSightings:
    frames, tags, corners = zip(*seen, strict=True) if seen else ((), (), np.zeros((0, 4, 2)))
    return TagSightings(np.array(frames), np.array(tags), np.array(corners), np.full(len(tags), 50.0))


def phone_scan(mesh: Mesh, poses: list[RigidTransform], camera: Camera = GLASSES) -> RoomScan:
    frames = tuple(ScanFrame(f"f{i}", i, camera, pose, image_path=Path("x.jpg")) for i, pose in enumerate(poses))
    return RoomScan(Path("room"), "made up", mesh, frames)


def seen_by(camera: Camera, pose: RigidTransform, tag: int) -> np.ndarray:
    return camera.project(pose.inv().apply(CORNERS.corners[tag]))


@pytest.fixture(scope="module")
def walls():
    mesh = room_mesh()
    return mesh, Raycaster(mesh)


def test_centre_rays_meet_the_scan_at_the_tags_centres_even_at_an_angle(walls):
    mesh, raycaster = walls
    poses = [stands_before(tag) for tag in TAGS]
    seen = [(i, tag, seen_by(PINHOLE, poses[i], tag)) for i, tag in enumerate(TAGS)]
    found = scan_tag_centers(phone_scan(mesh, poses, PINHOLE), raycaster, sightings_of(seen))
    assert found.tag_id.tolist() == list(TAGS)
    np.testing.assert_allclose(found.centers, CORNERS.centers, atol=1e-5)
    by_corner_means = [np.mean(corners, axis=0) for _, _, corners in seen]  # what half-hearted centres would be
    assert np.linalg.norm(by_corner_means - np.array([PINHOLE.width, PINHOLE.height]) / 2, axis=1).min() > 2.0


def test_a_lens_is_taken_out_of_the_rays(walls):
    mesh, raycaster = walls
    pose = stands_before(2, sideways_m=0.2, away_m=1.2) * RigidTransform.from_rotation(
        Rotation.from_rotvec([0.1, -0.35, 0.0])
    )
    found = scan_tag_centers(phone_scan(mesh, [pose]), raycaster, sightings_of([(0, 2, seen_by(GLASSES, pose, 2))]))
    np.testing.assert_allclose(found.centers[0], CORNERS.centers[2], atol=1e-5)


def test_the_scans_centre_is_the_mean_of_all_hits_wrong_ones_too(walls):
    mesh, raycaster = walls
    true = stands_before(0, sideways_m=0.0)
    along_wall = np.array([0.0, 0.0, 0.3])
    reported = [true, RigidTransform.from_translation(along_wall) * true]
    seen = [(i, 0, seen_by(PINHOLE, true, 0)) for i in range(2)]
    found = scan_tag_centers(phone_scan(mesh, reported, PINHOLE), raycaster, sightings_of(seen))
    np.testing.assert_allclose(found.centers[0], CORNERS.centers[0] + along_wall / 2, atol=1e-5)
    assert found.support.tolist() == [2]
    assert found.spread[0] == pytest.approx(0.15, abs=1e-5)


def test_a_tag_that_no_ray_puts_on_the_scan_is_left_out_with_a_note(walls):
    mesh, _ = walls
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    half = Mesh(mesh.vertices, mesh.faces[middles[:, 0] < 1.5])
    poses = [stands_before(0), stands_before(1)]
    seen = [(i, tag, seen_by(PINHOLE, poses[i], tag)) for i, tag in enumerate((0, 1))]
    found = scan_tag_centers(phone_scan(half, poses, PINHOLE), Raycaster(half), sightings_of(seen))
    assert found.tag_id.tolist() == [0]
    assert found.notes == ("Tag 1: no ray of its centre meets the scan; left out.",)


@pytest.mark.parametrize("frame", [-1, 1])
def test_a_sighting_in_a_frame_that_does_not_exist_is_a_sentence(walls, frame):
    mesh, raycaster = walls
    pose = stands_before(0)
    seen = sightings_of([(frame, 0, seen_by(PINHOLE, pose, 0))])
    with pytest.raises(InputError, match="1 frames with a picture"):
        scan_tag_centers(phone_scan(mesh, [pose], PINHOLE), raycaster, seen)


def test_no_sighting_is_no_tag(walls):
    mesh, raycaster = walls
    assert len(scan_tag_centers(phone_scan(mesh, []), raycaster, sightings_of([]))) == 0
    assert len(sfm_tag_centers(make_room(points=50).model, PINHOLE, sightings_of([])).centers) == 0


def tagged_model(*, on_tag=25, behind=6, blurred=5, tag=3, seed=0):
    """A model with points on one tag, a smaller clump behind it as seen from one image, some with a large error, and
    the walls; all seen in two images. With the sightings, the rows of the points on the tag, and these in sfm."""
    rng = np.random.default_rng(seed)
    room = make_room(points=2000, images=2)
    poses = [stands_before(tag, sideways) for sideways in (0.5, -0.4)]
    a, b, _, d = CORNERS.corners[tag]
    u, v = rng.uniform(0.1, 0.9, (2, on_tag + behind + blurred, 1))
    under = a + u * (b - a) + v * (d - a)
    along_ray = 0.5 * (CORNERS.centers[tag] - poses[0].translation)
    under[on_tag : on_tag + behind] = CORNERS.centers[tag] + along_ray + rng.normal(0, 0.01, (behind, 3))
    points = np.concatenate([under, room.scan_from_sfm.apply(room.model.points)])
    points[len(under) :] += 0.3 * np.sign(points[len(under) :])  # out of the way of the tag's outline
    errors = np.full(len(points), 0.5)
    errors[on_tag + behind : len(under)] = 5.0
    seen = [PINHOLE.project(pose.inv().apply(points)) for pose in poses]
    rows = [np.flatnonzero(PINHOLE.contains(pixels)) for pixels in seen]
    model = replace(
        room.model,
        sfm_from_camera=SFM_FROM_SCAN.compose_pose(RigidTransform.concatenate(poses)),
        frame_indices=np.array([40, 7]),
        points=SFM_FROM_SCAN.apply(points),
        point_colors=np.zeros((len(points), 3)),
        point_errors_px=errors,
        track_lengths=np.full(len(points), 2),
        observation_point=np.concatenate(rows),
        observation_image=np.repeat([0, 1], [len(r) for r in rows]),
        observation_px=np.concatenate([pixels[r] for pixels, r in zip(seen, rows, strict=True)]),
    )
    sightings = [(frame, tag, seen_by(PINHOLE, pose, tag)) for frame, pose in zip((40, 7), poses, strict=True)]
    return model, sightings, np.arange(on_tag), SFM_FROM_SCAN.apply(under[:on_tag])


def test_the_mean_of_the_largest_cluster_is_the_centre_and_the_rest_stays_visible():
    model, sightings, on_tag, expected = tagged_model()
    found = sfm_tag_centers(model, PINHOLE, sightings_of(sightings))
    assert found.centers.tag_id.tolist() == [3]
    np.testing.assert_allclose(found.centers.centers[0], expected.mean(axis=0), atol=1e-12)
    assert found.point[found.is_kept].tolist() == on_tag.tolist()
    assert set(range(36)) <= set(found.point.tolist())  # figure 9c: what was dropped, too
    assert found.centers.support.tolist() == [25]


def test_each_filter_does_its_part():
    """Without the threshold the blurred points join in; without clusters the clump behind the wall would."""
    model, sightings, on_tag, _ = tagged_model()
    seen = sightings_of(sightings)
    lenient = sfm_tag_centers(model, PINHOLE, seen, SfmTagCenterOptions(max_error_px=10))
    assert set(lenient.point[lenient.is_kept].tolist()) == {*on_tag.tolist(), *range(31, 36)}
    wide = sfm_tag_centers(model, PINHOLE, seen, SfmTagCenterOptions(radius_of_scene=10.0, neighbours=40))
    assert set(range(25, 31)) <= set(wide.point[wide.is_kept].tolist())


def test_a_mistaken_outline_is_not_forgiven():
    """Observations inside of an outline count, whichever way it winds: the same as OpenCV's polygon test."""
    rng = np.random.default_rng(5)
    room = make_room(points=400, images=1)
    pixels = rng.uniform(200, 400, (400, 2))
    model = replace(
        room.model,
        observation_point=np.arange(400),
        observation_image=np.zeros(400, int),
        observation_px=pixels,
    )
    for _ in range(20):
        angle = np.sort(rng.uniform(0, 2 * np.pi, 4))
        outline = 300 + 80 * np.column_stack([np.cos(angle), np.sin(angle)])
        for corners in (outline, outline[::-1]):
            found = sfm_tag_centers(model, PINHOLE, sightings_of([(0, 0, corners)]))
            inside = [cv2.pointPolygonTest(corners.astype(np.float32), tuple(p), False) > 0 for p in pixels.tolist()]
            assert found.point.tolist() == np.flatnonzero(inside).tolist()


def test_the_recipe_does_not_depend_on_the_reconstructions_own_scale_and_axes():
    model, sightings, _, _ = tagged_model()
    other = Similarity(40.0, Rotation.from_rotvec([2.0, 1.0, -0.4]), np.array([300.0, -20.0, 7.0]))
    moved = replace(model, points=other.apply(model.points), sfm_from_camera=other.compose_pose(model.sfm_from_camera))
    # The scene's size is that of a box along the axes, so the radius is only about the same.
    assert scene_size(moved.points) == pytest.approx(40 * scene_size(model.points), rel=0.5)
    first, second = (sfm_tag_centers(m, PINHOLE, sightings_of(sightings)) for m in (model, moved))
    assert second.is_kept.tolist() == first.is_kept.tolist()
    np.testing.assert_allclose(second.centers.centers, other.apply(first.centers.centers), rtol=1e-9)


def test_a_model_made_with_another_camera_is_brought_to_the_sightings_pixels():
    model, sightings, _, _ = tagged_model()
    half = Camera.pinhole(544, 540, 350.0, 350.0, 272.0, 270.0)
    halved = replace(model, cameras={1: half}, observation_px=model.observation_px / 2)
    first, second = (sfm_tag_centers(m, PINHOLE, sightings_of(sightings)) for m in (model, halved))
    assert second.point.tolist() == first.point.tolist()


def test_frames_that_are_not_registered_and_tags_without_points_are_left_out():
    model, sightings, _, _ = tagged_model()
    corner = np.array([[5.0, 25], [25, 25], [25, 5], [5, 5]])
    seen = sightings_of([*sightings, (7, 9, corner), (99, 8, sightings[0][2])])
    found = sfm_tag_centers(model, PINHOLE, seen)
    assert found.centers.tag_id.tolist() == [3]
    assert [note.split(":")[0] for note in found.centers.notes] == ["Tag 8", "Tag 9"]
    assert not found.is_kept[found.point_tag != 3].any()


def test_too_few_points_make_no_centre():
    model, sightings, _, _ = tagged_model(on_tag=4, behind=0, blurred=0)
    seen = sightings_of(sightings)
    assert len(sfm_tag_centers(model, PINHOLE, seen, SfmTagCenterOptions(radius_of_scene=0.1)).centers) == 1
    none = sfm_tag_centers(model, PINHOLE, seen, SfmTagCenterOptions(radius_of_scene=0.1, least_points=30))
    assert len(none.centers) == 0
    assert "fewer than 30" in none.centers.notes[0]


@pytest.mark.parametrize("field", ["max_error_px", "radius_of_scene", "neighbours", "least_points"])
def test_options_that_cannot_be_are_refused(field):
    with pytest.raises(InputError, match="above 0"):
        SfmTagCenterOptions(**{field: 0})


def centers(ids, places) -> TagCenters:
    return TagCenters.of({tag: np.array([place], float) for tag, place in zip(ids, places, strict=True)}, [])


def test_pairs_are_joined_by_id():
    scan = centers([7, 1, 4, 9], [(7, 0, 0), (1, 0, 0), (4, 0, 0), (9, 0, 0)])
    sfm = centers([9, 4, 7, 2], [(0, 9, 0), (0, 4, 0), (0, 7, 0), (0, 2, 0)])
    pairs = center_pairs(scan, sfm)
    assert pairs.names == ("tag 4", "tag 7", "tag 9")
    assert pairs.scan[:, 0].tolist() == pairs.sfm[:, 1].tolist() == [4, 7, 9]


@pytest.mark.parametrize("common", [0, 1, 2])
def test_fewer_than_three_common_tags_are_a_sentence_that_names_them(common):
    scan = centers([10, 11, 12], np.eye(3))
    sfm = centers([10 if common > 0 else 20, 11 if common > 1 else 21, 22], np.eye(3))
    with pytest.raises(GeometryError, match=f"there are {common}: the scan has tags 10, 11, 12"):
        center_pairs(scan, sfm)
