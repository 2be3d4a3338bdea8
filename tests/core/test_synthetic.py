"""Made-up scenes: the same for the same seed, in the layouts of real exports, and true where they say truth."""

import csv
import hashlib
import json
from dataclasses import replace
from pathlib import Path

import av
import cv2
import numpy as np
import pyapriltags
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from gazeloc_core.camera import Camera
from gazeloc_core.experiments.hardness import blur_px, hardness, turn_deg_per_s
from gazeloc_core.readers import open_recording, open_scan
from gazeloc_core.surfaces.raycast import Raycaster
from gazeloc_core.synthesis import glasses, paths, tags, truth
from gazeloc_core.synthesis.packing import packed
from gazeloc_core.synthesis.room import X, Z, subpixels
from gazeloc_core.synthesis.routes import ROUTES
from gazeloc_core.synthetic import (
    PRESETS,
    glasses_capture,
    read_options,
    recording_name,
    render,
    scene_room,
    truth_name,
    write_scene,
)

TINY = PRESETS["tiny"]
CORNER_BIAS_PX = 0.7
"""The sRGB curve makes white bleed into black, as in real pictures: corners move inwards, the centre stays."""


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("scene")
    write_scene(folder, TINY)
    return folder


@pytest.fixture(scope="module")
def room():
    return scene_room(replace(TINY, light_spacing_m=0.8, light_rays=1))


def hashes(folder: Path) -> dict[str, str]:
    files = sorted(p for p in folder.rglob("*") if p.is_file())
    return {str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest() for p in files}


def tum_rows(file: Path) -> list[list[str]]:
    return [line.split() for line in file.read_text().splitlines() if not line.startswith("#")]


def poses_of(rows: list[list[str]]) -> RigidTransform:
    values = np.array([[float(v) for v in row[1:]] for row in rows])
    return RigidTransform.from_components(values[:, :3], Rotation.from_quat(values[:, 3:]))


@pytest.mark.slow
def test_the_same_options_give_the_same_files(scene: Path, tmp_path: Path):
    write_scene(tmp_path, TINY)
    assert hashes(tmp_path) == hashes(scene)


def test_the_scan_opens_and_its_poses_drift_by_what_the_options_say(scene: Path):
    scan = open_scan(scene / "scan")
    true = poses_of(tum_rows(scene / "truth" / "phone.tum"))
    written = RigidTransform.concatenate([frame.scan_from_camera for frame in scan.frames])
    assert len(scan.frames) == TINY.phone_frames
    offset = written.translation - true.translation
    angle = np.degrees((true.rotation.inv() * written.rotation).magnitude())
    assert np.sqrt((offset**2).sum(axis=1).mean()) == pytest.approx(TINY.drift_m, rel=1e-3)
    assert np.sqrt((angle**2).mean()) == pytest.approx(TINY.drift_deg, rel=1e-2)
    assert np.abs(offset.mean(axis=0)).max() < 1e-5


def test_the_drift_is_smooth():
    seconds = np.linspace(0, 42, 421)
    wandering = paths.drift(seconds, 0.01, 0.2, 3)
    assert np.linalg.norm(np.diff(wandering.offset_m, axis=0), axis=1).max() < 0.001


def test_the_head_turns_at_an_easy_pace():
    seconds = np.arange(0, 21, 1 / 30)
    poses = paths.head_path(TINY.seed + 40).poses(seconds)
    turned = np.degrees((poses[:-1].rotation.inv() * poses[1:].rotation).magnitude()) * 30
    walked = np.linalg.norm(np.diff(poses.translation, axis=0), axis=1) * 30
    assert turned.max() < 130
    assert walked.max() < 1.5


@pytest.mark.parametrize("route", ROUTES)
def test_a_wearer_in_a_hurry_takes_the_same_way_faster(route):
    calm, quick = paths.head_path(3, route), paths.head_path(3, route, 1.5)
    seconds = np.arange(0, 14, 1 / 30)
    assert np.allclose(quick.poses(seconds).as_matrix(), calm.poses(seconds * 1.5).as_matrix())
    turned = np.degrees((calm.poses(seconds).rotation.inv() * calm.poses(seconds + 0.01).rotation).magnitude()) * 100
    assert turned.max() < 140
    eyes = calm.poses(seconds).translation
    assert (np.abs(eyes[:, [0, 2]]) < [X - 0.5, Z - 0.5]).all()
    assert np.linalg.norm(np.diff(eyes, axis=0), axis=1).max() * 30 < 1.5


def test_a_second_route_shares_the_scan(tmp_path: Path):
    small = replace(TINY, phone_frames=6, phone_seconds=6.0, glasses_seconds=0.2, exact_room=False)
    both = replace(small, routes=("first", "second"), hurry=(1.2, 1.4))
    write_scene(tmp_path, both)
    assert read_options(tmp_path) == both
    recordings = [open_recording(tmp_path / recording_name(route)) for route in both.routes]
    starts = []
    for route, recording in zip(both.routes, recordings, strict=True):
        rows = tum_rows(tmp_path / truth_name(route))
        assert [row[0] for row in rows] == [truth.seconds_text(t) for t in recording.timestamp_ns.tolist()]
        starts.append(poses_of(rows).translation[0])
        assert (
            tmp_path / "truth" / truth_name(route).replace("truth/glasses", "gaze3d").replace("tum", "csv")
        ).is_file()
    assert np.linalg.norm(starts[0] - starts[1]) > 1
    assert [glasses_capture(route, both).path.hurry for route in both.routes] == [1.2, 1.4]
    facts = hardness(tmp_path, both, "second")
    assert 5 < facts.mean_grey < 200
    assert facts.blur_p90_px > 0


def test_what_was_written_before_there_were_routes_is_described_as_then(scene: Path):
    options = json.loads((scene / "scene.json").read_text())["options"]
    assert {"routes", "hurry"}.isdisjoint(options)
    assert read_options(scene) == TINY


def test_table_two_has_two_settings_of_markers_each_plain_and_hard():
    scenes = {name: options for name, options in PRESETS.items() if name.startswith("table2-")}
    assert set(scenes) == {f"table2-{setting}-{kind}" for setting in "ab" for kind in ("plain", "hard")}
    assert all(options.routes == ("first", "second") for options in scenes.values())
    for setting in "ab":
        plain, hard = scenes[f"table2-{setting}-plain"], scenes[f"table2-{setting}-hard"]
        assert set(hard.tag_ids) < set(plain.tag_ids)
        assert (len(hard.tag_ids), hard.bare, hard.tag_size_m) == (5, True, plain.tag_size_m)
        assert min(hard.hurry) > max(plain.hurry)
        assert hard.glasses_gain < plain.glasses_gain
    assert set(scenes["table2-a-plain"].tag_ids).isdisjoint(scenes["table2-b-plain"].tag_ids)


def test_blur_by_the_exact_path_is_the_exposure_times_the_speed_of_the_picture(room):
    capture = glasses.GlassesCapture(
        glasses.lens((272, 270)),
        glasses.START_NS + np.arange(20) * 100_000_000,
        paths.head_path(5),
        scene_transform(),
        0.01,
    )
    caster = Raycaster(room.mesh)
    blur = blur_px(capture, caster)
    assert np.allclose(blur_px(replace(capture, exposure_s=0.02), caster), 2 * blur, rtol=0.05, atol=0.02)
    turning = np.radians(turn_deg_per_s(capture)) * capture.camera.focal_px.mean() * capture.exposure_s
    fast = turning > np.median(turning)
    assert np.median(blur[fast] / turning[fast]) == pytest.approx(1, abs=0.35)  # walking adds, the edges stretch


def test_phone_times_are_those_of_the_truth_to_the_last_digit(scene: Path):
    for index, row in enumerate(tum_rows(scene / "truth" / "phone.tum")):
        frame = json.loads((scene / "scan" / f"frame_{index:05d}.json").read_text())
        assert f"{frame['time']:.9f}" == row[0]


def test_the_projection_matrix_has_the_half_pixel_that_the_intrinsics_lack(scene: Path):
    frame = json.loads((scene / "scan" / "frame_00003.json").read_text())
    cx, cy = frame["intrinsics"][2], frame["intrinsics"][5]
    width, height = TINY.phone_size_px
    assert (1 - frame["projectionMatrix"][2]) / 2 * width == pytest.approx(cx + 0.5, abs=1e-3)
    assert (1 + frame["projectionMatrix"][6]) / 2 * height == pytest.approx(cy + 0.5, abs=1e-3)


def test_depth_agrees_with_the_mesh_at_the_written_poses(scene: Path):
    scan = open_scan(scene / "scan")
    caster = Raycaster(scan.mesh)
    errors = []
    for frame in scan.frames:
        depth = frame.read_depth_m()
        camera = frame.camera.scaled(depth.shape[1], depth.shape[0])
        rays = camera.unproject(camera.pixel_centres())
        turned = rays @ frame.scan_from_camera.rotation.as_matrix().T
        hits = caster.cast(frame.scan_from_camera.translation, turned)
        errors.append(np.abs(hits.distance * rays[:, 2] - depth.ravel()))
    error = np.concatenate(errors)
    assert np.median(error[np.isfinite(error)]) < TINY.voxel_m / 2


def test_the_recording_opens_with_its_own_times(scene: Path):
    recording = open_recording(scene / "recording")
    rows = tum_rows(scene / "truth" / "glasses.tum")
    assert [truth.seconds_text(t) for t in recording.timestamp_ns.tolist()] == [row[0] for row in rows]
    assert recording.camera.model == "FULL_OPENCV"
    assert np.allclose(recording.camera.params, glasses.lens(TINY.glasses_size_px).params)


def test_video_times_are_those_of_the_table(scene: Path):
    with (scene / "recording" / "world_timestamps.csv").open() as file:
        times = np.array([int(row["timestamp [ns]"]) for row in csv.DictReader(file)])
    (video,) = (scene / "recording").glob("*.mp4")
    with av.open(str(video)) as container:
        seconds = [float(frame.pts * frame.time_base) for frame in container.decode(video=0)]
    assert np.allclose(np.array(seconds) - seconds[0], (times - times[0]) / 1e9, atol=1e-4)


def test_frame_rates_vary_and_frames_are_dropped():
    steps = np.diff(glasses.frame_times(20.0, 30.0, 1)) / 1e9
    assert np.median(steps) == pytest.approx(1 / 30, rel=0.01)
    assert steps.std() > 0.0005
    assert steps.max() > 1.8 / 30
    assert steps.min() > 0


def test_gaze_angles_belong_to_gaze_pixels_and_lie_a_degree_from_the_truth(scene: Path):
    recording = open_recording(scene / "recording")
    with (scene / "recording" / "gaze.csv").open() as file:
        rows = list(csv.DictReader(file))
    with (scene / "truth" / "gaze3d.csv").open() as file:
        hits = np.array([[float(row[f"hit {a} [m]"]) for a in "xyz"] for row in csv.DictReader(file)])
    pixels = np.array([[float(row["gaze x [px]"]), float(row["gaze y [px]"])] for row in rows]) + 0.5
    rays = recording.camera.unproject(pixels)
    azimuth = np.array([float(row["azimuth [deg]"]) for row in rows])
    assert np.allclose(np.degrees(np.arctan2(rays[:, 0], rays[:, 2])), azimuth, atol=0.01)
    path = paths.head_path(TINY.seed + 40)
    capture = glasses.GlassesCapture(
        recording.camera, recording.timestamp_ns, path, scene_transform(), TINY.glasses_exposure_s
    )
    poses = capture.poses_at(np.array([int(row["timestamp [ns]"]) for row in rows]))
    ways = poses.inv().apply(hits)
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    error = np.degrees(np.arccos(np.clip((ways * rays).sum(axis=1), -1, 1)))
    assert 0.05 < np.median(error) < 2.5


def scene_transform() -> RigidTransform:
    from gazeloc_core.synthesis.room import SCAN_FROM_ROOM

    return SCAN_FROM_ROOM


def test_true_tag_corners_project_onto_detected_ones(room):
    detector = pyapriltags.Detector(families=tags.FAMILY, quad_decimate=1.0)
    camera = Camera.pinhole(640, 480, 520.0, 520.0, 320.3, 239.6)
    found = set()
    for tag in room.tags:
        center = tag.corners.mean(axis=0)
        right, up = tag.corners[1] - tag.corners[0], tag.corners[3] - tag.corners[0]
        away = np.cross(right, up) / np.linalg.norm(np.cross(right, up))
        eye = center + 1.0 * away + 0.25 * np.array([0.3, 1.0, 0.2])
        pose = RigidTransform.from_components(eye[None], paths.looking(eye[None], center[None]))[0]
        rgb, depth = render(room, camera, pose, room.phone_exposure)
        for detection in detector.detect(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY)):
            if detection.tag_id != tag.tag_id:
                continue
            error = detection.corners - camera.project(pose.inv().apply(np.array(tag.corners)))
            assert np.abs(error).max() < CORNER_BIAS_PX
            assert np.abs(error.mean(axis=0)).max() < 0.1
            found.add(tag.tag_id)
        u, v = camera.project(pose.inv().apply(center[None]))[0].astype(int)
        assert depth[v, u] == pytest.approx(np.linalg.norm(center - eye), abs=0.01)
    assert len(room.tags) == 8
    assert found == set(range(8))


def test_tags_are_spread_in_all_three_dimensions(room):
    centers = np.array([tag.corners.mean(axis=0) for tag in room.tags])
    spread = np.linalg.svd(centers - centers.mean(axis=0), compute_uv=False) / np.sqrt(len(centers))
    assert spread.min() > 0.35
    sides = [np.linalg.norm(np.roll(tag.corners, 1, axis=0) - tag.corners, axis=1) for tag in room.tags]
    assert np.allclose(sides, TINY.tag_size_m, atol=1e-9)


def test_the_lens_is_a_function_up_to_the_corners():
    camera = glasses.lens()
    pixels = camera.pixel_centres()[::997]
    assert np.abs(camera.project(camera.unproject(pixels)) - pixels).max() < 1e-3


def test_subpixels_are_centred():
    for count in (1, 3, 4):
        assert np.abs(np.mean(subpixels(count), axis=0)).max() < 1e-12


def test_packed_rectangles_do_not_overlap():
    rng = np.random.default_rng(1)
    sizes = [(int(w), int(h)) for w, h in rng.integers(2, 60, (80, 2))]
    corners, height = packed(sizes, 256, 2)
    used = np.zeros((height, 256), dtype=int)
    for (x, y), (w, h) in zip(corners, sizes, strict=True):
        used[y : y + h, x : x + w] += 1
    assert used.max() == 1
    assert used.sum() == sum(w * h for w, h in sizes)


def test_blur_grows_with_the_exposure(room):
    path, camera = paths.head_path(5), glasses.lens((272, 270))
    time = np.array([glasses.START_NS + 2_550_000_000])
    sharpness = []
    for exposure_s in (0.0005, 0.06):
        capture = glasses.GlassesCapture(camera, time, path, scene_transform(), exposure_s)
        picture = glasses.exposed(room, capture, glasses.shot_rays(camera), int(time[0]))
        sharpness.append(float(np.abs(np.diff(picture, axis=1)).mean()))
    assert sharpness[1] < 0.8 * sharpness[0]
