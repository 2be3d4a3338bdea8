"""3D Scanner App exports: conventions against an exact box room, and the maker's own sample."""

import json
import time

import cv2
import numpy as np
import pytest
from data import SHARED, needs_shared
from tiny_captures import ROOM_M, picture, write_scan

from gazeloc_core.errors import InputError
from gazeloc_core.readers import depth_agreement, open_scan
from gazeloc_core.surfaces.raycast import Raycaster

CHAIR = SHARED / "3dscannerapp_chair" / "chair_scan"


def test_poses_intrinsics_and_depth_agree_with_the_mesh_exactly(tmp_path):
    scan = open_scan(write_scan(tmp_path))
    agreement = depth_agreement(scan)
    assert agreement.frames == 4
    assert agreement.share_hit == 1
    assert agreement.median_m < 0.001  # depth is written in whole millimetres
    assert scan.up_axis == "y"
    assert [frame.timestamp_ns for frame in scan.frames[:2]] == [402896_500000000, 402897_000000000]


def test_pictures_smaller_than_their_intrinsics_scale_the_camera(tmp_path):
    camera = open_scan(write_scan(tmp_path, jpg=(96, 72))).frames[0].camera
    assert (camera.width, camera.height) == (96, 72)
    np.testing.assert_allclose(camera.focal_px, 60)
    np.testing.assert_allclose(camera.principal_point_px, [(95.3 + 0.5) / 2, (70.1 + 0.5) / 2])


def test_without_projection_matrix_the_size_is_told_by_the_centre_and_said(tmp_path):
    write_scan(tmp_path, jpg=(192, 144))
    for file in tmp_path.glob("frame_*.json"):
        value = json.loads(file.read_text())
        del value["projectionMatrix"]
        file.write_text(json.dumps(value))
    scan = open_scan(tmp_path)
    np.testing.assert_allclose(scan.frames[0].camera.focal_px, 120)
    assert any("taken to be for 192x144" in note for note in scan.notes)


@pytest.mark.parametrize("wrong", ["no flip", "inverse", "flipped world"])
def test_a_wrong_axis_convention_fails_loudly(tmp_path, wrong):
    write_scan(tmp_path)
    for file in tmp_path.glob("frame_*.json"):
        value = json.loads(file.read_text())
        pose, flip = np.reshape(value["cameraPoseARFrame"], (4, 4)), np.diag([1.0, -1, -1, 1])
        changed = {"no flip": pose @ flip, "inverse": np.linalg.inv(pose), "flipped world": flip @ pose}[wrong]
        value["cameraPoseARFrame"] = changed.ravel().tolist()
        file.write_text(json.dumps(value))
    with pytest.raises(InputError, match="wrong axis convention"):
        open_scan(tmp_path)


def test_a_mesh_whose_picture_is_missing_is_coloured_from_the_frames(tmp_path):
    write_scan(tmp_path, textured=False)
    for i in range(4):  # pictures of one colour, so that the right answer is known
        cv2.imwrite(str(tmp_path / f"frame_{i:05d}.jpg"), np.full((72, 96, 3), (30, 90, 200), np.uint8))
    scan = open_scan(tmp_path)
    assert any("textured_output.jpg, which is not there" in note for note in scan.notes)
    assert any("coloured from 4 posed frames" in note for note in scan.notes)
    caster = Raycaster(scan.mesh)
    hits = caster.cast(ROOM_M / 2, -scan.frames[0].scan_from_camera.rotation.as_matrix()[:, 2:].T * -1)
    assert np.abs(caster.colors(hits)[0].astype(int) - (200, 90, 30)).max() <= 3


def test_a_texture_that_is_there_is_kept(tmp_path):
    scan = open_scan(write_scan(tmp_path))
    assert scan.mesh.texture is not None
    expected = cv2.cvtColor(cv2.imread(str(tmp_path / "textured_output.jpg")), cv2.COLOR_BGR2RGB)
    np.testing.assert_array_equal(scan.mesh.texture.images[0], expected)
    np.testing.assert_allclose(scan.mesh.texture.uv_of_corner[0], [[0, 0], [1, 0], [1, 1]])


def test_frames_without_picture_keep_their_pose(tmp_path):
    write_scan(tmp_path)
    (tmp_path / "frame_00001.jpg").unlink()
    scan = open_scan(tmp_path)
    assert len(scan.frames) == 4
    assert [frame.name for frame in scan.frames_with_images] == ["frame_00000", "frame_00002", "frame_00003"]


@needs_shared
def test_the_makers_sample_opens_and_its_depth_agrees():
    start = time.perf_counter()
    scan = open_scan(CHAIR, colored=False)
    assert time.perf_counter() - start < 15
    assert len(scan.frames) == 70
    assert len(scan.frames_with_images) == 24
    agreement = depth_agreement(scan, frames_checked=24)
    assert agreement.median_m <= 0.015
    assert agreement.share_hit > 0.9
    assert any("textured_output.jpg, which is not there" in note for note in scan.notes)


@needs_shared
@pytest.mark.slow
def test_the_sample_coloured_from_its_frames_looks_like_them():
    scan = open_scan(CHAIR)
    frame = scan.frames_with_images[8]
    camera = frame.camera.scaled(96, 72)
    rays = camera.unproject(camera.pixel_centres()) @ frame.scan_from_camera.rotation.as_matrix().T
    caster = Raycaster(scan.mesh)
    hits = caster.cast(frame.scan_from_camera.translation, rays)
    drawn = caster.colors(hits)[hits.is_hit].astype(float)
    photo = cv2.resize(frame.read_image(), (96, 72), interpolation=cv2.INTER_AREA).reshape(-1, 3)[hits.is_hit]
    assert np.median(np.abs(drawn - photo).max(axis=1)) < 30
    shuffled = np.random.default_rng(0).permutation(photo.astype(float))
    assert np.abs(drawn - photo).mean() < 0.6 * np.abs(drawn - shuffled).mean()


def test_colouring_leaves_what_no_frame_sees_grey_blue(tmp_path):
    write_scan(tmp_path, textured=False, frames=1)
    cv2.imwrite(str(tmp_path / "frame_00000.jpg"), picture(96, 72, 3))
    scan = open_scan(tmp_path)
    caster = Raycaster(scan.mesh)
    backward = scan.frames[0].scan_from_camera.rotation.as_matrix()[:, 2] * -1
    np.testing.assert_array_equal(caster.colors(caster.cast(ROOM_M / 2, [backward]))[0], (122, 132, 148))
