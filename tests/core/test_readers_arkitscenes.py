"""ARKitScenes videos: conventions against OpenCV on the files' own numbers, and against an exact room."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from app_project import MARKS, room_mesh, true_poses
from tiny_arkitscenes import LOWRES, START_S, VIDEO, WIDE, matrix, write_arkitscenes

from gazeloc_core.errors import InputError
from gazeloc_core.evaluation.evaluate import pose_errors
from gazeloc_core.readers import depth_agreement, open_scan

FRAMES = 4


def test_depth_agrees_with_the_mesh_at_the_poses_read(tmp_path):
    scan = open_scan(write_arkitscenes(tmp_path))
    agreement = depth_agreement(scan)
    assert (agreement.frames, agreement.share_hit) == (FRAMES, 1)
    assert agreement.median_m < 0.001  # depth is written in whole millimetres
    assert (scan.format, scan.up_axis) == ("ARKitScenes", "z")
    assert scan.mesh.colors is not None
    np.testing.assert_allclose(scan.mesh.bounds, room_mesh().bounds, atol=1e-6)


def test_poses_are_the_true_ones(tmp_path):
    frames = open_scan(write_arkitscenes(tmp_path)).frames
    for frame, truth in zip(frames, true_poses(FRAMES), strict=True):
        rotation_deg, position_m = pose_errors(frame.scan_from_camera, truth)
        assert rotation_deg[0] < 1e-5
        assert position_m[0] < 1e-6


@pytest.mark.parametrize("wide", [False, True])
def test_pixels_are_opencvs_on_the_files_numbers_and_half_a_pixel(tmp_path, wide):
    """OpenCV's projection from the text files, which puts (0, 0) where we put (0.5, 0.5)."""
    write_arkitscenes(tmp_path, wide=wide)
    frames = open_scan(tmp_path).frames
    inside = tmp_path / f"{VIDEO}_frames"
    points = np.random.default_rng(0).uniform((0.2, 0.1, 0.1), (1.6, 0.8, 1.6), (50, 3))
    lines = (inside / "lowres_wide.traj").read_text().splitlines()
    for frame, line in zip(frames, lines, strict=True):
        row = np.array(line.split(), float)
        number = frames.index(frame)
        k = matrix(WIDE if wide else LOWRES, number)
        expected = cv2.projectPoints(points, row[1:4], row[4:], k, None)[0].reshape(-1, 2)
        found = frame.camera.project(frame.scan_from_camera.inv().apply(points))
        np.testing.assert_allclose(found, expected + 0.5, atol=1e-4)


def test_pictures_show_what_the_poses_say(tmp_path):
    """Marks of known colours on the walls have their colour where the reader's camera puts them."""
    frames = open_scan(write_arkitscenes(tmp_path, wide=True)).frames
    looked_at = 0
    for frame in frames:
        picture = frame.read_image()
        for number in (0, 2):
            centre, outward, color = MARKS[number]
            at = frame.camera.project(frame.scan_from_camera.inv().apply([np.add(centre, np.multiply(outward, 0.01))]))
            if frame.camera.contains(at)[0]:
                looked_at += 1
                np.testing.assert_allclose(picture[int(at[0, 1]), int(at[0, 0])], color, atol=2)
    assert looked_at >= 3


def test_the_best_pictures_that_have_poses_are_taken(tmp_path):
    low, wide = (open_scan(write_arkitscenes(tmp_path / name, wide=name == "wide")) for name in ("low", "wide"))
    assert {(frame.camera.width, frame.camera.height) for frame in low.frames} == {LOWRES}
    assert {(frame.camera.width, frame.camera.height) for frame in wide.frames} == {WIDE}
    assert all(frame.depth_path is not None and frame.confidence_path is not None for frame in wide.frames)
    for picture in (tmp_path / "wide" / f"{VIDEO}_frames" / "wide").glob("*.png"):
        picture.unlink()
    assert {frame.camera.width for frame in open_scan(tmp_path / "wide").frames} == {LOWRES[0]}


def test_pictures_without_a_pose_are_left_out_and_counted(tmp_path):
    scan = open_scan(write_arkitscenes(tmp_path))
    assert len(scan.frames) == FRAMES
    assert any(f"{FRAMES} of the {2 * FRAMES} pictures in lowres_wide" in note for note in scan.notes)
    assert [frame.timestamp_ns for frame in scan.frames[:2]] == [305_377_000_000, 305_477_000_000]


def test_both_layouts_are_recognised_and_say_why(tmp_path):
    three, raw = (open_scan(write_arkitscenes(tmp_path / name, raw=name == "raw")) for name in ("3dod", "raw"))
    assert three.notes[0] == f"Recognised as ARKitScenes: it holds {VIDEO}_frames/lowres_wide.traj."
    assert raw.notes[0] == "Recognised as ARKitScenes: it holds lowres_wide.traj."
    for first, second in zip(three.frames, raw.frames, strict=True):
        np.testing.assert_array_equal(first.scan_from_camera.as_matrix(), second.scan_from_camera.as_matrix())


def test_a_frames_own_files_are_all_of_its_moment(tmp_path):
    """Whoever holds a frame out takes along what else shows it."""
    scan = open_scan(write_arkitscenes(tmp_path, wide=True))
    names = {path.relative_to(tmp_path / f"{VIDEO}_frames").as_posix() for path in scan.frames[1].own_files}
    time = f"{VIDEO}_{START_S + 0.1:.3f}"
    assert names == {
        *(f"{kind}/{time}.png" for kind in ("wide", "lowres_wide", "lowres_depth", "confidence")),
        *(f"{kind}_intrinsics/{time}.pincam" for kind in ("wide", "lowres_wide")),
    }
    assert all(path.is_file() for frame in scan.frames for path in frame.own_files)


@pytest.mark.parametrize("wrong", ["camera to world", "ARKit axes"])
def test_a_wrong_convention_fails_loudly(tmp_path, wrong):
    write_arkitscenes(tmp_path, raw=True)
    lines = []
    for row in np.loadtxt(tmp_path / "lowres_wide.traj"):
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = cv2.Rodrigues(row[1:4])[0], row[4:]
        pose = np.linalg.inv(pose) if wrong == "camera to world" else np.diag([1.0, -1, -1, 1]) @ pose
        lines.append(" ".join(map(str, (row[0], *cv2.Rodrigues(pose[:3, :3])[0].ravel(), *pose[:3, 3]))))
    (tmp_path / "lowres_wide.traj").write_text("\n".join(lines))
    with pytest.raises(InputError, match="wrong axis convention"):
        open_scan(tmp_path)


def test_without_depth_the_poses_are_taken_on_trust_and_it_says_so(tmp_path):
    write_arkitscenes(tmp_path, raw=True)
    for path in (tmp_path / "lowres_depth").iterdir():
        Path(path).unlink()
    scan = open_scan(tmp_path)
    assert all(frame.depth_path is None for frame in scan.frames)
    assert any("could not be checked" in note for note in scan.notes)
