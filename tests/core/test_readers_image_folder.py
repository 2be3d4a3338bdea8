"""Folders of images with a camera file, the real bedroom and the real chair's frames among them."""

import json
import re
import shutil

import numpy as np
import pytest
from data import SHARED, needs_shared
from tiny_captures import DISTORTION, MATRIX, VIDEO_SIZE, write_csv, write_image_folder

from gazeloc_core.camera import Camera
from gazeloc_core.readers import open_recording, open_scan

BEDROOM = SHARED / "swatbotics_room_B"


def test_without_times_frames_are_a_second_apart_in_natural_order_and_this_is_said(tmp_path):
    recording = open_recording(write_image_folder(tmp_path))
    assert [path.name for path in recording.frames.paths] == ["f_1.jpg", "f_2.jpg", "f_10.jpg"]
    np.testing.assert_array_equal(recording.timestamp_ns, [0, 10**9, 2 * 10**9])
    assert any("1 s apart" in note for note in recording.notes)


def test_with_times_their_order_counts(tmp_path):
    write_image_folder(tmp_path)
    rows = [["f_10.jpg", 5], ["f_1.jpg", 7], ["f_2.jpg", 1650316509598345895]]
    write_csv(tmp_path / "timestamps.csv", ["name", "timestamp_ns"], rows)
    recording = open_recording(tmp_path)
    assert [path.name for path in recording.frames.paths] == ["f_10.jpg", "f_1.jpg", "f_2.jpg"]
    np.testing.assert_array_equal(recording.timestamp_ns, [5, 7, 1650316509598345895])


@pytest.mark.parametrize("kind", ["scene_camera.json", "cameras.txt"])
def test_other_camera_files_give_the_same_camera(tmp_path, kind):
    expected = open_recording(write_image_folder(tmp_path)).camera
    (tmp_path / "camera.json").unlink()
    if kind == "cameras.txt":
        numbers = " ".join(str(p) for p in expected.params)
        (tmp_path / kind).write_text(f"# comment\n1 FULL_OPENCV {VIDEO_SIZE[0]} {VIDEO_SIZE[1]} {numbers}\n")
    else:
        (tmp_path / kind).write_text(json.dumps({"camera_matrix": MATRIX, "dist_coefs": DISTORTION}))
    camera = open_recording(tmp_path).camera
    assert camera.model == expected.model
    np.testing.assert_array_equal(camera.params, expected.params)


@needs_shared
def test_the_real_bedroom_opens_with_its_stated_camera(tmp_path):
    facts = (BEDROOM / "FACTS.txt").read_text()
    fx, fy, cx, cy = (float(v) for v in re.search(r"= ([\d.]+) ([\d.]+) ([\d.]+) ([\d.]+)", facts).groups())
    for image in (BEDROOM / "images").iterdir():
        (tmp_path / image.name).symlink_to(image)
    camera = Camera.from_opencv(816, 612, [[fx, 0, cx], [0, fy, cy], [0, 0, 1]], [])
    (tmp_path / "camera.json").write_text(json.dumps(camera.to_json()))
    recording = open_recording(tmp_path)
    assert len(recording) == 31
    np.testing.assert_allclose(recording.camera.principal_point_px, [394.22, 305.16])
    for index in (0, 30):
        assert recording.frames.read(index).shape == (612, 816, 3)
    assert recording.frames.paths[-1].name == "IMG_1458.JPG"


@needs_shared
def test_half_of_the_real_chairs_frames_open_as_a_recording(tmp_path):
    scan = open_scan(SHARED / "3dscannerapp_chair" / "chair_scan", colored=False)
    half = scan.frames_with_images[1::2]
    for frame in half:
        shutil.copy(frame.image_path, tmp_path)
    (tmp_path / "camera.json").write_text(json.dumps(half[len(half) // 2].camera.to_json()))
    rows = [[frame.image_path.name, frame.timestamp_ns] for frame in half]
    write_csv(tmp_path / "timestamps.csv", ["name", "timestamp_ns"], rows)
    recording = open_recording(tmp_path)
    np.testing.assert_array_equal(recording.timestamp_ns, [frame.timestamp_ns for frame in half])
    assert len(recording) == 12
    assert recording.frames.read(11).shape == (1440, 1920, 3)
