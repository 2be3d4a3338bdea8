"""A scan's own distortion: told from wrong poses by what all frames see, and never a misalignment of all of them.

The pictures' shifts are made up by exact projection of the displaced places, not by the equations that are solved.
"""

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from gazeloc_core.camera import Camera
from gazeloc_core.evaluation.apparent_motion import apparent_motion, tile_equations
from gazeloc_core.evaluation.picture_tiles import Tiles
from gazeloc_core.evaluation.scan_distortion import DistortionOptions, scan_distortion

LENS = Camera.pinhole(320, 318, 225, 225, 160, 159)
NO_ERROR = RigidTransform.identity()


def bent(places):
    """A scan that is off by up to 2 cm, differently at every wall."""
    x, y, z = places.T
    return 0.02 * np.column_stack([np.sin(1.9 * y), np.cos(1.7 * x), np.sin(1.5 * (x + z))])


def straight(places):
    return np.zeros_like(places)


def pose_number(i):
    """A head in the middle of a room of 6 x 5 x 2.5 m that looks around as it walks."""
    centre = (2.5 + np.cos(0.3 * i), 2.5 + np.sin(0.3 * i), 1.6)
    return RigidTransform.from_components(
        centre, Rotation.from_euler("xz", [-95 - 10 * np.sin(i), 23 * i], degrees=True)
    )


def depth_in_room(pose, rays):
    """Along each ray, how far the walls of the room are."""
    directions = rays @ pose.rotation.as_matrix().T
    with np.errstate(divide="ignore"):
        ends = np.where(
            directions > 0, (np.array([6, 5, 2.5]) - pose.translation) / directions, -pose.translation / directions
        )
    return ends.min(axis=1) * rays[:, 2]


def equations(i, *, error=NO_ERROR, off=straight, noise_px=0.1):
    """A frame that shows the true room, its pose in error, compared with a scan that is `off`."""
    true, rng = pose_number(i), np.random.default_rng(i)
    pose = true * error
    center = np.stack(np.meshgrid(np.arange(26, 300, 24), np.arange(26, 300, 24)), axis=-1).reshape(-1, 2).astype(float)
    rays = LENS.unproject(center)
    depth = depth_in_room(pose, rays)
    on_scan = pose.apply(rays * (depth / rays[:, 2])[:, None])
    seen = LENS.project(true.inv().apply(on_scan + off(on_scan)))
    shift = seen - center + rng.normal(0, noise_px, seen.shape)
    best = np.ones(len(center))
    tiles = Tiles(center, shift, best, np.broadcast_to(np.eye(2), (len(center), 2, 2)), depth)
    return tile_equations(tiles, LENS, pose)


def moved(*, shift=(0, 0, 0), turn_deg=(0, 0, 0)):
    return RigidTransform.from_components(shift, Rotation.from_rotvec(turn_deg, degrees=True))


def shifts_m(frames, distortion):
    """How far each camera looks off."""
    found = [apparent_motion(f, None if distortion is None else distortion.at(f.place_in_scan)) for f in frames]
    return np.linalg.norm([motion.value[3:] for motion in found], axis=1)


def test_the_motion_is_the_one_that_leads_back_to_the_true_pose():
    error = moved(shift=(0.02, -0.01, 0.015), turn_deg=(0.3, 0.5, -0.2))
    found = apparent_motion(equations(3, error=error, noise_px=0))
    back = error.inv()
    np.testing.assert_allclose(found.value[3:], back.translation, atol=1e-3)
    np.testing.assert_allclose(np.degrees(found.value[:3]), back.rotation.as_rotvec(degrees=True), atol=0.02)


def test_it_is_not_surer_than_many_draws_are_alike():
    frame = equations(2, noise_px=0)
    rng, drawn = np.random.default_rng(0), []
    shift = frame.shift
    for _ in range(200):
        object.__setattr__(frame, "shift", shift + rng.normal(0, 0.5, shift.shape))
        found = apparent_motion(frame)
        drawn.append(found.value)
    ratio = np.std(drawn, axis=0) / np.sqrt(np.diag(found.covariance))
    assert (ratio > 0.4).all()
    assert (ratio < 1).all()


def test_true_poses_look_off_a_bent_scan_and_do_not_once_its_distortion_is_known():
    frames = [equations(i, off=bent) for i in range(60)]
    distortion = scan_distortion(frames)
    assert np.median(shifts_m(frames, None)) > 0.03
    assert np.median(shifts_m(frames, distortion)) < 0.01


def test_a_wrong_pose_still_looks_off_by_as_much_as_it_is():
    wrong = [5, 17, 33, 48]
    frames = [equations(i, off=bent, error=moved(shift=(0.04, 0, 0)) if i in wrong else NO_ERROR) for i in range(60)]
    found = shifts_m(frames, scan_distortion(frames))
    assert found[wrong] == pytest.approx(0.04, abs=0.015)
    assert np.percentile(np.delete(found, wrong), 95) < 0.02


def test_a_misalignment_of_all_frames_is_no_distortion():
    away = moved(shift=(0.03, 0.02, -0.01), turn_deg=(0, 0, 0.4))  # of the scan, not of the cameras

    def misaligned(places):
        return away.apply(places) - places

    frames = [equations(i, off=misaligned) for i in range(60)]
    distortion = scan_distortion(frames)
    assert np.linalg.norm(distortion.displacement_m, axis=1).max() < 0.006
    assert shifts_m(frames, distortion).min() > 0.025


def test_few_frames_tell_nothing_apart():
    assert scan_distortion([equations(i) for i in range(11)]) is None


def test_a_large_scan_gets_a_coarser_grid():
    frames = [equations(i, off=bent) for i in range(20)]
    coarse = scan_distortion(frames, DistortionOptions(most_nodes=60))
    assert len(coarse.displacement_m) <= 60
    assert coarse.spacing_m in (2.0, 4.0)


def test_there_is_no_displacement_far_from_what_was_seen():
    distortion = scan_distortion([equations(i, off=bent) for i in range(20)])
    np.testing.assert_array_equal(distortion.at(np.array([[100.0, 0, 0], [-50, 3, 1]])), 0)
    at_nodes = distortion.at(distortion.nodes)
    np.testing.assert_allclose(at_nodes, distortion.displacement_m, atol=1e-12)


def test_tiles_are_read_back_from_their_table():
    rng = np.random.default_rng(0)
    half = rng.normal(size=(5, 2, 2))
    tiles = Tiles(*rng.normal(size=(2, 5, 2)), rng.random(5), half + half.transpose(0, 2, 1), rng.random(5))
    again = Tiles.of_table(tiles.table())
    for name in ("center_px", "shift_px", "best", "sharpness", "depth_m"):
        np.testing.assert_allclose(getattr(again, name), getattr(tiles, name), rtol=1e-6)
