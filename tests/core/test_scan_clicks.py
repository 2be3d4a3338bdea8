"""Clicks in the phone's posed frames against places that are known exactly, and what must not give a place."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from gazeloc_core.camera import Camera
from gazeloc_core.clicks.scan_clicks import ScanClickOptions, triangulate_on_scan
from gazeloc_core.errors import GeometryError
from gazeloc_core.keypoints import Sighting
from gazeloc_core.scan import Mesh, RoomScan, ScanFrame

PLACE = np.array([0.2, 0.1, 3.0])
CLICK_PX, POSE_DEG = 1.5, 0.2


def scan_with(poses: RigidTransform) -> RoomScan:
    """A scan whose frames have cameras of their own, like a phone's; every second pose has no picture."""
    mesh = Mesh(np.array([[0, 0, 3], [1, 0, 3], [0, 1, 3]]), np.array([[0, 1, 2]]))
    frames = []
    for i in range(len(poses)):
        camera = Camera.pinhole(960, 720, 720 + i, 720 + i, 480 + 2 * i, 350 - i)
        frames.append(ScanFrame(f"frame_{i:05d}", 2 * i, camera, poses[i], Path(f"frame_{i:05d}.jpg")))
        frames.append(ScanFrame(f"between_{i}", 2 * i + 1, camera, RigidTransform.identity()))
    return RoomScan(Path("scan"), "test", mesh, tuple(frames))


def poses_at(x_m: list[float]) -> RigidTransform:
    """Cameras side by side that look along z."""
    centres = np.column_stack([x_m, np.zeros(len(x_m)), np.zeros(len(x_m))])
    return RigidTransform.from_components(centres, Rotation.from_rotvec(np.outer(-0.3 * np.array(x_m), [0, 1, 0])))


def clicks(scan: RoomScan, place: np.ndarray, noise: np.ndarray | float = 0.0) -> list[Sighting]:
    seen = []
    for i, frame in enumerate(scan.frames_with_images):
        x, y = frame.camera.project(frame.scan_from_camera.inv().apply(place)[None])[0]
        dx, dy = np.broadcast_to(noise, (len(scan.frames_with_images), 2))[i]
        seen.append(Sighting(i, float(x + dx), float(y + dy)))
    return seen


def test_exact_clicks_give_the_place_whatever_the_mesh_says():
    scan = scan_with(poses_at([-0.5, 0.0, 0.6]))
    found = triangulate_on_scan(scan, clicks(scan, PLACE))
    np.testing.assert_allclose(found.point, PLACE, atol=1e-6)
    assert found.is_reliable


def test_sigma_is_what_clicks_and_poses_are_off_by():
    rng = np.random.default_rng(0)
    true = poses_at([-0.8, 0.1, 0.7])
    squares, sigmas = [], []
    for _ in range(150):
        turned = true * RigidTransform.from_rotation(Rotation.from_rotvec(rng.normal(0, np.radians(POSE_DEG), (3, 3))))
        seen = clicks(scan_with(turned), PLACE, rng.normal(0, CLICK_PX, (3, 2)))
        found = triangulate_on_scan(scan_with(true), seen)
        squares.append(np.mean((found.point - PLACE) ** 2))
        sigmas.append(found.sigma)
    assert np.sqrt(np.mean(squares)) == pytest.approx(np.mean(sigmas), rel=0.25)


def test_clicks_on_different_things_are_not_reliable():
    scan = scan_with(poses_at([-0.5, 0.0, 0.6]))
    seen = clicks(scan, PLACE, np.array([[0, 0], [0, 40.0], [0, 0]]))
    assert not triangulate_on_scan(scan, seen).is_reliable


def test_two_frames_from_nearly_the_same_side_are_refused_unless_allowed():
    scan = scan_with(poses_at([0.0, 0.1]))  # 1.9 degrees at three metres
    with pytest.raises(GeometryError, match="further away"):
        triangulate_on_scan(scan, clicks(scan, PLACE))
    allowed = triangulate_on_scan(scan, clicks(scan, PLACE), ScanClickOptions(min_parallax_deg=1.0))
    np.testing.assert_allclose(allowed.point, PLACE, atol=1e-5)


@pytest.mark.parametrize(
    ("frames", "words"),
    [((), "at least two"), ((0,), "at least two"), ((0, 2), "no phone frame 2"), ((-1, 0), "no phone frame -1")],
)
def test_clicks_that_are_too_few_or_in_frames_that_are_not_there_are_refused(frames: tuple[int, ...], words: str):
    scan = scan_with(poses_at([-0.5, 0.6]))
    with pytest.raises(GeometryError, match=words):
        triangulate_on_scan(scan, [Sighting(frame, 400.0, 300.0) for frame in frames])
