"""Tag corners on a wall and in a reconstruction, against places that are known exactly."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from gazeloc_core.camera import Camera
from gazeloc_core.errors import InputError
from gazeloc_core.scan import Mesh, RoomScan, ScanFrame
from gazeloc_core.sfm_model import SfmModel
from gazeloc_core.stages import inputs
from gazeloc_core.surfaces.raycast import Raycaster
from gazeloc_core.tag_types import TagSightings
from gazeloc_core.tags.corners import map_scan_corners, triangulate_sfm_corners
from gazeloc_core.tags.square import UNIT_SQUARE, fit_plane, fit_square, inside_of_tag_px, tag_centre_px

CAMERA = Camera.pinhole(960, 720, 720, 720, 480, 360)
SIZE_M = 0.16


def tag_on_wall(x: float, y: float, turn_deg: float = 0) -> np.ndarray:
    """Corners (4, 3) of a tag on the wall z = 3, seen from the origin: x right, y down, z into the wall."""
    turn = Rotation.from_euler("z", turn_deg, degrees=True).as_matrix()
    return np.column_stack([UNIT_SQUARE * SIZE_M, np.zeros(4)]) @ turn.T + [x, y, 3.0]


TAGS = {2: tag_on_wall(-0.6, 0.1), 5: tag_on_wall(0.4, -0.3, 30), 7: tag_on_wall(0.1, 0.5, 10)}


def wall(noise_m: float = 0.0, hole: bool = False, seed: int = 0) -> Raycaster:
    """The wall as a grid of 4 cm, bumpy, maybe without its upper half."""
    x, y = np.meshgrid(np.arange(-3, 3, 0.04), np.arange(-2, 2, 0.04))
    z = 3 + np.random.default_rng(seed).normal(0, 1, x.shape) * noise_m
    index = np.arange(x.size).reshape(x.shape)
    a, b, c, d = index[:-1, :-1].ravel(), index[:-1, 1:].ravel(), index[1:, 1:].ravel(), index[1:, :-1].ravel()
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    if hole:
        faces = faces[y.ravel()[faces[:, 0]] > 0.2]
    return Raycaster(Mesh(np.column_stack([x.ravel(), y.ravel(), z.ravel()]), faces))


def phone_poses(count: int) -> RigidTransform:
    x = np.linspace(-0.8, 0.8, count)
    centres = np.column_stack([x, 0.1 * np.cos(5 * x), 0.3 * np.sin(3 * x)])
    return RigidTransform.from_components(centres, Rotation.from_rotvec(np.outer(-0.2 * x, [0, 1, 0])))


def drifted(poses: RigidTransform, rng: np.random.Generator) -> RigidTransform:
    """Poses that are off by a centimetre and 0.2°."""
    n = len(poses)
    off = RigidTransform.from_components(
        rng.normal(0, 0.01 / np.sqrt(3), (n, 3)),
        Rotation.from_rotvec(rng.normal(0, np.radians(0.2 / np.sqrt(3)), (n, 3))),
    )
    return poses * off


def sight(poses: RigidTransform, tags: dict[int, np.ndarray], noise_px: float = 0.0, seed: int = 0) -> TagSightings:
    """The tags as all cameras see them; a frame for each pose."""
    rng = np.random.default_rng(seed)
    rows = [(k, i, CAMERA.project(poses[k].inv().apply(c))) for k in range(len(poses)) for i, c in tags.items()]
    corners = np.array([row[2] for row in rows]).reshape(-1, 4, 2) + rng.normal(0, noise_px, (len(rows), 4, 2))
    return TagSightings(
        np.array([r[0] for r in rows]), np.array([r[1] for r in rows]), corners, np.full(len(rows), 50.0)
    )


def scan_of(raycaster: Raycaster, poses: RigidTransform) -> RoomScan:
    frames = tuple(ScanFrame(f"{k}", k, CAMERA, poses[k], Path(f"{k}.jpg")) for k in range(len(poses)))
    return RoomScan(Path("scan"), "test", raycaster.mesh, frames)


def worst_error(answer, tags: dict[int, np.ndarray]) -> float:
    return max(
        np.linalg.norm(c - tags[int(i)], axis=1).max() for i, c in zip(answer.tag_id, answer.corners, strict=True)
    )


def test_exact_input_gives_exact_corners_on_the_scan() -> None:
    poses, mesh = phone_poses(5), wall()
    answer = map_scan_corners(scan_of(mesh, poses), mesh, sight(poses, TAGS), tag_size_m=SIZE_M)
    assert answer.tag_id.tolist() == [2, 5, 7]
    assert worst_error(answer, TAGS) < 1e-4
    assert answer.sightings.tolist() == [5, 5, 5]
    assert answer.spread.max() < 1e-4


@pytest.mark.parametrize(("size", "bound_m"), [(SIZE_M, 0.010), (None, 0.013)])
def test_drift_and_a_bumpy_mesh_leave_a_centimetre(size: float | None, bound_m: float) -> None:
    rng = np.random.default_rng(4)
    poses = phone_poses(20)
    seen, mesh = sight(poses, TAGS, 0.3), wall(0.01)
    answer = map_scan_corners(scan_of(mesh, drifted(poses, rng)), mesh, seen, tag_size_m=size)
    assert worst_error(answer, TAGS) < bound_m
    assert (answer.spread > 0.005).all()  # the drift is reported, not hidden
    assert (answer.spread < 0.03).all()


@pytest.mark.parametrize("scan_scale", [0.9, 1.0, 1.03])
def test_the_scale_of_the_scan_shows_in_its_tags_though_they_are_drawn_as_printed(scan_scale: float) -> None:
    poses, mesh = phone_poses(6), wall().mesh
    in_scan = RigidTransform.from_components(scan_scale * poses.translation, poses.rotation)
    scaled = Raycaster(Mesh(scan_scale * mesh.vertices, mesh.faces))
    answer = map_scan_corners(scan_of(scaled, in_scan), scaled, sight(poses, TAGS), tag_size_m=SIZE_M)
    sides = np.linalg.norm(answer.corners - np.roll(answer.corners, 1, axis=1), axis=2)
    np.testing.assert_allclose(sides, SIZE_M, rtol=1e-6)
    assert answer.free_scale(SIZE_M) == pytest.approx(scan_scale, abs=1e-3)
    kept = inputs.load_corners(inputs.corners_arrays(answer))
    assert kept.free_scale(SIZE_M) == answer.free_scale(SIZE_M)


def test_tags_of_before_do_not_say_the_scale_of_the_scan() -> None:
    poses, mesh = phone_poses(2), wall()
    columns = inputs.corners_arrays(map_scan_corners(scan_of(mesh, poses), mesh, sight(poses, TAGS)))
    del columns["free_side"]
    assert inputs.load_corners(columns).free_scale(SIZE_M) is None


def test_a_tag_seen_once_counts_and_admits_its_uncertainty() -> None:
    poses, mesh = phone_poses(1), wall(0.005)
    answer = map_scan_corners(scan_of(mesh, poses), mesh, sight(poses, TAGS), tag_size_m=SIZE_M)
    assert len(answer) == 3
    assert worst_error(answer, TAGS) < 0.02
    assert (answer.spread > 0.01).all()


def test_tags_over_a_hole_are_found_by_their_rays_alone_or_left_out() -> None:
    mesh = wall(hole=True)  # only tag 7 hangs where there is a mesh
    poses = phone_poses(6)
    several = map_scan_corners(scan_of(mesh, poses), mesh, sight(poses, TAGS), tag_size_m=SIZE_M)
    assert several.tag_id.tolist() == [2, 5, 7]
    assert worst_error(several, TAGS) < 1e-3
    once = map_scan_corners(scan_of(mesh, poses), mesh, sight(poses[[2]], TAGS), tag_size_m=SIZE_M)
    assert once.tag_id.tolist() == [7]
    assert len(once.notes) == 2
    assert "left out" in once.notes[0]


def test_an_id_on_two_walls_is_left_out_on_the_scan() -> None:
    poses, mesh = phone_poses(8), wall()
    twin = {2: tag_on_wall(0.9, 0.1)}
    half = [sight(poses[[k]], (TAGS if k % 2 else TAGS | twin)) for k in range(8)]
    seen = TagSightings(
        np.repeat(np.arange(8), 3),
        *(np.concatenate([getattr(h, name) for h in half]) for name in ("tag_id", "corners_px", "decision_margin")),
    )
    answer = map_scan_corners(scan_of(mesh, poses), mesh, seen, tag_size_m=SIZE_M)
    assert answer.tag_id.tolist() == [5, 7]
    assert answer.notes == ("Tag 2 is seen in two places; left out, print each id once.",)


def model_of(poses: RigidTransform, frame_indices: np.ndarray) -> SfmModel:
    n, none = len(poses), np.empty(0)
    names = tuple(f"{i}.jpg" for i in frame_indices)
    empty_points = (np.empty((0, 3)), np.empty((0, 3), np.uint8), none, none, none, none, np.empty((0, 2)))
    return SfmModel({1: CAMERA}, names, np.ones(n), poses, frame_indices, *empty_points)


def test_corners_in_the_reconstruction_over_registered_frames_only() -> None:
    poses = phone_poses(9)
    seen = sight(poses, TAGS, 0.2)
    registered = np.array([0, 2, 3, 5, 8])
    answer = triangulate_sfm_corners(model_of(poses[registered], registered), CAMERA, seen)
    assert answer.tag_id.tolist() == [2, 5, 7]
    assert worst_error(answer, TAGS) < 0.008
    assert answer.sightings.max() == 5
    assert ((answer.spread > 1e-5) & (answer.spread < 0.005)).all()


def test_tags_that_are_not_determined_are_left_out_of_the_reconstruction() -> None:
    poses = phone_poses(6)
    seen = sight(poses[[3]], TAGS)
    answer = triangulate_sfm_corners(model_of(poses, np.arange(6) - 3), CAMERA, seen)  # frame 0 is image 3
    assert len(answer) == 0
    assert len(answer.notes) == 3
    nothing = triangulate_sfm_corners(model_of(poses, np.arange(6) + 100), CAMERA, seen)
    assert len(nothing) == 0


def test_an_id_on_two_walls_is_left_out_of_the_reconstruction() -> None:
    poses = phone_poses(10)
    moved = TAGS | {5: tag_on_wall(-0.9, 0.4)}
    parts = [sight(poses[[k]], TAGS if k < 6 else moved) for k in range(10)]
    seen = TagSightings(
        np.repeat(np.arange(10), 3),
        *(np.concatenate([getattr(p, name) for p in parts]) for name in ("tag_id", "corners_px", "decision_margin")),
    )
    answer = triangulate_sfm_corners(model_of(poses, np.arange(10)), CAMERA, seen)
    assert answer.tag_id.tolist() == [2, 7]
    assert "two places" in answer.notes[0]


def test_no_sightings_give_no_corners() -> None:
    poses, mesh = phone_poses(2), wall()
    nothing = sight(poses, {})
    assert len(map_scan_corners(scan_of(mesh, poses), mesh, nothing, tag_size_m=SIZE_M)) == 0
    assert len(triangulate_sfm_corners(model_of(poses, np.arange(2)), CAMERA, nothing)) == 0


@pytest.mark.parametrize("size", [0.0, -0.1, 16.0, float("nan")])
def test_an_impossible_tag_size_is_refused(size: float) -> None:
    poses, mesh = phone_poses(2), wall()
    with pytest.raises(InputError, match="tag size"):
        map_scan_corners(scan_of(mesh, poses), mesh, sight(poses, TAGS), tag_size_m=size)


def test_the_centre_is_where_the_diagonals_cross() -> None:
    pose = RigidTransform.from_components([1.5, 0, 1.8], Rotation.from_euler("y", -50, degrees=True))  # a slanted look
    corners = TAGS[2] + [0.8, 0, 0]
    centre = CAMERA.project(pose.inv().apply(corners.mean(axis=0)))[0]
    px = CAMERA.project(pose.inv().apply(corners))
    np.testing.assert_allclose(tag_centre_px(px), centre, atol=1e-6)
    assert np.linalg.norm(px.mean(axis=0) - centre) > 0.5  # the mean of the corners is somewhere else
    np.testing.assert_allclose(inside_of_tag_px(px, 3)[4], centre, atol=1e-3)


def test_a_plane_is_found_among_outliers() -> None:
    rng = np.random.default_rng(6)
    points = np.column_stack([rng.uniform(-1, 1, (60, 2)), rng.normal(0, 0.002, 60)])
    points[:8, 2] += 0.3
    middle, normal, _ = fit_plane(points)
    assert abs(normal[2]) > 0.999
    assert abs(middle @ normal) < 0.01


def test_a_square_keeps_its_size_and_its_order() -> None:
    turn = Rotation.from_rotvec([0.3, -0.8, 1.2]).as_matrix()
    square = np.column_stack([UNIT_SQUARE * SIZE_M, np.zeros(4)]) @ turn.T + [1, 2, 3]
    bent = square + np.random.default_rng(7).normal(0, 0.003, (4, 3))
    for side in (SIZE_M, None):
        fitted = fit_square(bent, side)
        sides = np.linalg.norm(fitted - np.roll(fitted, 1, axis=0), axis=1)
        np.testing.assert_allclose(sides, sides[0])
        assert np.linalg.norm(fitted - square, axis=1).max() < 0.006
    np.testing.assert_allclose(fit_square(square, None), square, atol=1e-9)
