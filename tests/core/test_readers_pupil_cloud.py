"""Pupil Cloud exports: both spellings of the calibration, times, gaze, and lost frames."""

import json

import cv2
import numpy as np
import pandas as pd
import pytest
from data import SHARED, needs_shared
from scipy.optimize import least_squares
from tiny_captures import (
    DISTORTION,
    MATRIX,
    START_NS,
    VIDEO_SIZE,
    frame_times_ns,
    picture,
    write_csv,
    write_recording,
    write_video,
)

from gazeloc_core.camera import Camera
from gazeloc_core.errors import InputError
from gazeloc_core.readers import open_recording
from gazeloc_core.readers.pupil_files import read_gaze


def test_frames_times_camera_and_gaze(tmp_path):
    recording = open_recording(write_recording(tmp_path))
    assert len(recording) == 12
    np.testing.assert_array_equal(recording.timestamp_ns, frame_times_ns())
    camera = recording.camera
    assert (camera.model, camera.width, camera.height) == ("FULL_OPENCV", *VIDEO_SIZE)
    np.testing.assert_allclose(camera.params, [60, 60.5, 31.7, 30.9, *DISTORTION])
    np.testing.assert_allclose(recording.gaze.pixels[3], [23.5, 30.75])
    np.testing.assert_array_equal(recording.gaze.fixation_id[[0, 7, 19]], [0, 1, 3])
    assert recording.gaze.worn.all()


def test_each_frame_is_the_one_of_its_index(tmp_path):
    recording = open_recording(write_recording(tmp_path))
    for index in (11, 0, 5):
        error = np.abs(recording.frames.read(index).astype(int) - picture(*VIDEO_SIZE, index))
        assert np.median(error) < 12


def test_the_other_spelling_and_flat_lists_and_odd_headers(tmp_path):
    write_recording(tmp_path)
    value = {"camera_matrix": np.ravel(MATRIX).tolist(), "distortion_coefficients": DISTORTION}
    (tmp_path / "scene_camera.json").write_text(json.dumps(value))
    gaze = tmp_path / "gaze.csv"
    gaze.write_text(gaze.read_text().replace("gaze x [px]", "Gaze X [px] ").replace("timestamp", "Timestamp"))
    recording = open_recording(tmp_path)
    np.testing.assert_allclose(recording.camera.params[4:], DISTORTION)
    assert recording.gaze.pixels[0, 0] == 20.5


@pytest.mark.parametrize("lost", [0, 4, 11])
def test_a_frame_lost_from_the_video_is_found_by_the_rhythm(tmp_path, lost):
    write_recording(tmp_path)
    times = frame_times_ns()
    del times[lost]
    write_video(next(tmp_path.glob("*.mp4")), times)
    recording = open_recording(tmp_path)
    np.testing.assert_array_equal(recording.timestamp_ns, times)
    assert any("11 frames but world_timestamps.csv 12 rows" in note for note in recording.notes)


@pytest.mark.parametrize("lost", [0, 4, 11])
def test_a_row_lost_from_the_times_is_found_by_the_rhythm(tmp_path, lost):
    write_recording(tmp_path)
    times = frame_times_ns()
    del times[lost]
    write_csv(tmp_path / "world_timestamps.csv", ["timestamp [ns]"], [[time] for time in times])
    recording = open_recording(tmp_path)
    np.testing.assert_array_equal(recording.timestamp_ns, times)
    error = np.abs(recording.frames.read(5).astype(int) - picture(*VIDEO_SIZE, 5 + (lost <= 5)))
    assert np.median(error) < 12


def test_a_steady_rhythm_with_a_lost_end_is_refused(tmp_path):
    write_recording(tmp_path)
    steady = [START_NS + 33_000_000 * i for i in range(12)]
    write_csv(tmp_path / "world_timestamps.csv", ["timestamp [ns]"], [[time] for time in steady])
    write_video(next(tmp_path.glob("*.mp4")), steady[:-1])
    with pytest.raises(
        InputError, match=r"11 frames but world_timestamps\.csv 12 rows, their times fit in several ways"
    ):
        open_recording(tmp_path)


def fitted_camera(pixels_opencv, azimuth, elevation):
    """OpenCV's rational model fitted to rows of the vendor's own pixel and angle pairs, by OpenCV alone."""
    points = np.column_stack([np.tan(azimuth), -np.tan(elevation) / np.cos(azimuth), np.ones(len(azimuth))])

    def residuals(p):
        matrix = np.array([[p[0], 0, p[2]], [0, p[1], p[3]], [0, 0, 1]])
        projected, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), matrix, p[4:])
        return (projected[:, 0] - pixels_opencv).ravel()

    start = [770, 770, 544, 540, -0.13, 0.11, 0, 0, 0, 0.17, 0.05, 0.02]
    scale = [100, 100, 10, 10, *[0.1] * 8]
    fit = least_squares(residuals, start, x_scale=scale, loss="soft_l1", f_scale=0.01)
    return np.array([[fit.x[0], 0, fit.x[2]], [0, fit.x[1], fit.x[3]], [0, 0, 1]]), fit.x[4:]


@needs_shared
def test_pixels_become_the_vendors_own_angles_half_pixel_included():
    path = SHARED / "pupil_invisible_gaze" / "gaze.csv"
    table = pd.read_csv(path)
    gaze = read_gaze(path)
    assert len(gaze) == len(table)
    azimuth, elevation = np.radians(table["azimuth [deg]"].to_numpy()), np.radians(table["elevation [deg]"].to_numpy())
    raw = table[["gaze x [px]", "gaze y [px]"]].to_numpy()
    subset = np.flatnonzero(np.isfinite(azimuth))[::15]
    matrix, distortion = fitted_camera(raw[subset], azimuth[subset], elevation[subset])
    camera = Camera.from_opencv(1088, 1080, matrix, distortion)
    rays = np.column_stack(
        [np.sin(azimuth) * np.cos(elevation), -np.sin(elevation), np.cos(azimuth) * np.cos(elevation)]
    )
    error_px = np.linalg.norm(camera.project(rays) - gaze.pixels, axis=1)
    assert np.median(error_px) < 0.001
    back = camera.unproject(gaze.pixels)
    angle_deg = np.degrees(np.linalg.norm(np.cross(back, rays), axis=1))
    assert np.median(angle_deg) < 0.0002
