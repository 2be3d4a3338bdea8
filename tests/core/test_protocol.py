"""Holding frames out: the method's scan does not know them, the recording shows them, the truth is theirs."""

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from data import SHARED, needs_shared
from fake_project import contents
from scipy.spatial.transform import RigidTransform
from tiny_arkitscenes import VIDEO, write_arkitscenes
from tiny_captures import picture, write_scan

from gazeloc_core.camera import Camera
from gazeloc_core.errors import InputError, ProjectError
from gazeloc_core.evaluation.evaluate import evaluate, pose_errors
from gazeloc_core.evaluation.protocol import (
    ProtocolOptions,
    held_out_frames,
    make_protocol_project,
    write_recording,
    write_scan_without,
    write_truth,
)
from gazeloc_core.evaluation.truth import read_tum
from gazeloc_core.project import Project, TagEntry
from gazeloc_core.readers import open_recording, open_scan
from gazeloc_core.scan import RoomScan, ScanFrame
from gazeloc_core.stages import inputs
from gazeloc_core.trajectory import PoseStatus, Trajectory

SIZE = (200, 150)


def scanner_app(folder: Path) -> Path:
    return write_scan(folder, frames=7, jpg=(192, 144))


def video(folder: Path) -> Path:
    return write_arkitscenes(folder, frames=7, wide=True)


WRITERS = {"3D Scanner App": scanner_app, "ARKitScenes": video}


def ramp(camera: Camera) -> np.ndarray:
    """What a camera sees of a wall at infinity whose red and green are the direction: smooth, so resampled exactly."""
    rays = camera.unproject(camera.pixel_centres())
    direction = (rays[:, :2] / rays[:, 2:] * 120 + 128).reshape(camera.height, camera.width, 2)
    return np.dstack([np.full(direction.shape[:2], 40.0), direction[..., ::-1]]).clip(0, 255).round().astype(np.uint8)


def frame_of(folder: Path, number: int, focal: float, shift: float) -> ScanFrame:
    camera = Camera.pinhole(*SIZE, focal, focal, SIZE[0] / 2 + shift, SIZE[1] / 2 - 2 * shift)
    path = folder / f"frame_{number:05d}.png"
    folder.mkdir(exist_ok=True)
    cv2.imwrite(str(path), ramp(camera))
    pose = RigidTransform.from_translation([0.1 * number, 0, 0])
    return ScanFrame(path.stem, 10**9 * number, camera, pose, path, own_files=(path,))


@pytest.mark.parametrize("kind", WRITERS)
def test_the_methods_scan_and_the_recording_share_nothing(tmp_path, kind):
    source = WRITERS[kind](tmp_path / "source")
    whole = open_scan(source, colored=False)
    project = make_protocol_project(tmp_path / "project", source, options=ProtocolOptions(every=3))
    left, recording = inputs.load_scan(project), inputs.load_recording(project, "held-out")
    names = [frame.name for frame in whole.frames]
    held = [path.stem for path in recording.frames.paths]
    assert held == names[::3]
    assert [frame.name for frame in left.frames] == [name for name in names if name not in held]
    assert left.format == whole.format
    np.testing.assert_array_equal(left.mesh.vertices, whole.mesh.vertices)
    files = {path.relative_to(project.folder / "held_out" / "scan").as_posix() for path in left.path.rglob("*")}
    for frame in whole.frames[::3]:
        assert not files & {path.relative_to(source).as_posix() for path in frame.own_files}


@pytest.mark.parametrize("kind", WRITERS)
def test_the_truth_is_the_held_out_frames_poses_at_their_times(tmp_path, kind):
    source = WRITERS[kind](tmp_path / "source")
    whole = open_scan(source, colored=False)
    project = make_protocol_project(tmp_path / "project", source)
    entry = project.recording("held-out")
    times, poses = read_tum(entry.truth)
    assert times.tolist() == open_recording(entry.path).timestamp_ns.tolist()
    assert times.tolist() == [frame.timestamp_ns for frame in whole.frames[::2]]
    for pose, frame in zip(poses, whole.frames[::2], strict=True):
        rotation_deg, position_m = pose_errors(pose, frame.scan_from_camera)
        assert rotation_deg[0] < 1e-6
        assert position_m[0] < 1e-8


def test_the_true_poses_evaluate_as_perfect(tmp_path):
    source = scanner_app(tmp_path / "source")
    project = make_protocol_project(tmp_path / "project", source, name="phone")
    held = held_out_frames(open_scan(source, colored=False))
    times = open_recording(project.recording("phone").path).timestamp_ns
    poses = RigidTransform.concatenate([frame.scan_from_camera for frame in held])
    status = np.full(len(held), PoseStatus.REGISTERED.value)
    trajectory = Trajectory.from_poses(times, status, np.ones(len(held), bool), np.arange(len(held)), poses)
    found = evaluate(trajectory, *read_tum(project.recording("phone").truth))
    assert (found.keyframes, found.registered, found.without_truth) == (4, 4, 0)
    assert found.position_m.max < 1e-8


def test_pictures_are_resampled_to_one_camera(tmp_path):
    """A phone refocuses: each picture must show each direction where the common camera puts it, to a grey level."""
    frames = tuple(frame_of(tmp_path / "f", i, 180 + 4 * i, 2.3 * (i - 2)) for i in range(5))
    write_recording(frames, tmp_path / "recording")
    recording = open_recording(tmp_path / "recording")
    assert recording.camera.to_json() == frames[2].camera.to_json()
    expected = cv2.cvtColor(ramp(recording.camera), cv2.COLOR_BGR2RGB)
    for _, rgb in recording.frames.iterate(range(5)):
        seen = rgb[..., 2] > 30  # a few pixels of border were not in every picture
        assert seen.mean() > 0.85
        inner = cv2.erode(seen.astype(np.uint8), np.ones((7, 7), np.uint8)) > 0
        inner[:8], inner[-8:], inner[:, :8], inner[:, -8:] = 0, 0, 0, 0
        assert np.abs(rgb.astype(int) - expected)[inner].max() <= 1


def test_half_a_pixel_is_not_lost_in_resampling(tmp_path):
    """A picture of half the size: the centre of its first pixel is not that of the large picture's first pixel."""
    small = Camera.pinhole(100, 75, 90, 90, 50, 37.5)
    frames = tuple(frame_of(tmp_path / "f", i, 180, 0) for i in range(3))
    path = tmp_path / "f" / "frame_00000.png"
    cv2.imwrite(str(path), ramp(small))
    write_recording((replace(frames[0], camera=small), *frames[1:]), tmp_path / "recording")
    found = cv2.imread(str(tmp_path / "recording" / path.name)).astype(int)
    assert np.abs(found - ramp(frames[1].camera))[8:-8, 8:-8].max() <= 1


def test_a_share_is_drawn_at_random_by_its_seed(tmp_path):
    scan = open_scan(write_scan(tmp_path, frames=12), colored=False)
    drawn = [[f.name for f in held_out_frames(scan, ProtocolOptions(share=0.4, seed=seed))] for seed in (0, 0, 1)]
    assert len(drawn[0]) == 5
    assert drawn[0] == sorted(drawn[0]) == drawn[1] != drawn[2]


def test_frames_without_picture_are_never_held_out(tmp_path):
    write_scan(tmp_path, frames=8)
    for i in (0, 3):
        (tmp_path / f"frame_{i:05d}.jpg").unlink()
    held = held_out_frames(open_scan(tmp_path, colored=False))
    assert [frame.name for frame in held] == ["frame_00001", "frame_00004", "frame_00006"]


def test_the_project_can_be_moved_and_the_scan_is_left_alone(tmp_path):
    source = scanner_app(tmp_path / "source")
    before = contents(source)
    tags = TagEntry(family="tag36h11", size_m=0.16)
    project = make_protocol_project(tmp_path / "project", source, tags=tags)
    assert contents(source) == before
    assert project.settings.tags == tags
    project.folder.rename(tmp_path / "moved")
    moved = Project.open(tmp_path / "moved")
    assert open_scan(moved.settings.scan.path, colored=False).path.is_relative_to(moved.folder)
    assert moved.recording("held-out").truth == moved.folder / "held_out" / "truth.tum"


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (ProtocolOptions(every=1), r"Every 1 frames .*; hold out every second"),
        (ProtocolOptions(every=4), r"of its 7 posed frames with pictures 2 would be held out; at least 3"),
        (ProtocolOptions(share=0.99), r"7 would be held out; .* some must stay; hold out another share"),
        (ProtocolOptions(share=1.5), r"share to hold out is 1\.5; it must lie between 0 and 1"),
        (ProtocolOptions(share=float("nan")), r"share to hold out is nan"),
    ],
)
def test_shares_that_make_no_sense_are_refused(tmp_path, options, sentence):
    with pytest.raises(InputError, match=sentence):
        held_out_frames(open_scan(scanner_app(tmp_path), colored=False), options)


def test_a_failure_leaves_nothing_behind(tmp_path):
    source = video(tmp_path / "source")
    path = source / f"{VIDEO}_frames" / "wide" / f"{VIDEO}_305.577.png"
    path.write_bytes(path.read_bytes()[:100])  # its head says its size, the rest is lost
    with pytest.raises(InputError, match=r"305\.577\.png: the picture does not decode"):
        make_protocol_project(tmp_path / "project", source)
    assert [path.name for path in tmp_path.iterdir()] == ["source"]


def test_folders_in_use_are_refused(tmp_path):
    source = scanner_app(tmp_path / "source")
    with pytest.raises(ProjectError, match="not empty"):
        make_protocol_project(source, source)
    with pytest.raises(ProjectError, match="inside the scan"):
        make_protocol_project(source / "project", source)
    (tmp_path / "file").write_text("x")
    with pytest.raises(ProjectError, match=r"cannot be written \(.*\); name another"):
        make_protocol_project(tmp_path / "file" / "project", source)


def test_a_bare_mesh_has_nothing_to_hold_out(tmp_path):
    source = scanner_app(tmp_path / "source")
    (tmp_path / "room.glb").write_bytes(b"")
    mesh_only = RoomScan(tmp_path / "room.glb", "GLB mesh", open_scan(source).mesh)
    with pytest.raises(InputError, match="of its 0 posed frames"):
        held_out_frames(mesh_only)


def test_a_frame_whose_files_are_not_known_cannot_be_hidden(tmp_path):
    scan = open_scan(scanner_app(tmp_path), colored=False)
    nameless = replace(scan.frames[0], own_files=())
    with pytest.raises(InputError, match="does not say which files are of frame frame_00000 alone"):
        write_scan_without(scan, (nameless,), tmp_path / "out")


def test_a_lens_with_distortion_is_refused(tmp_path):
    (tmp_path / "a.png").write_bytes(cv2.imencode(".png", picture(64, 62, 0))[1].tobytes())
    lens = Camera.from_opencv(64, 62, np.diag([50.0, 50.0, 1.0]), [0.1, 0, 0, 0])
    frame = ScanFrame("a", 0, lens, RigidTransform.identity(), tmp_path / "a.png")
    with pytest.raises(InputError, match="Frame a has a FULL_OPENCV camera; undistort"):
        write_recording((frame,), tmp_path / "recording")


def test_a_videos_frames_are_gone_in_every_resolution(tmp_path):
    source = video(tmp_path / "source")
    project = make_protocol_project(tmp_path / "project", source)
    inside = project.settings.scan.path / f"{VIDEO}_frames"
    for kind in ("wide", "lowres_wide", "lowres_depth", "confidence"):
        assert not (inside / kind / f"{VIDEO}_305.377.png").exists()
        assert (inside / kind / f"{VIDEO}_305.477.png").exists()
    assert json.loads((project.recording("held-out").path / "camera.json").read_text())["width"] == 480


@needs_shared
def test_the_chairs_held_out_frames_are_twelve_and_share_a_camera(tmp_path):
    source = SHARED / "3dscannerapp_chair" / "chair_scan"
    scan = open_scan(source, colored=False)
    held = held_out_frames(scan)
    assert len(held) == 12
    write_scan_without(scan, held, tmp_path / "scan")
    assert len(open_scan(tmp_path / "scan", colored=False).frames) == 58
    write_truth(held, tmp_path / "truth.tum")
    assert np.diff(read_tum(tmp_path / "truth.tum")[0]).min() > 0.9e9
    write_recording(held[:3], tmp_path / "recording")
    assert (open_recording(tmp_path / "recording").camera.width, held[0].camera.width) == (1920, 1920)
