"""Bad recordings, as a table: Pupil Cloud exports and folders of images."""

import os
import shutil
from pathlib import Path
from typing import Any

import cv2
import pytest
from bad_input import Act, Table, change_json, check_refused, cut, remove, write
from tiny_captures import (
    DISTORTION,
    START_NS,
    frame_times_ns,
    picture,
    write_csv,
    write_image_folder,
    write_recording,
    write_video,
)

from gazeloc_core.readers import open_recording

table = Table()
pupil = table.damaged("pupil", write_recording, open_recording)
images = table.damaged("images", write_image_folder, open_recording)
TIMES, CAMERA = "world_timestamps.csv", "scene_camera.json"


def the_video(folder: Path) -> Path:
    return next(folder.glob("*.mp4"))


def video_as_folder(folder: Path) -> None:
    the_video(folder).unlink()
    (folder / "a.mp4").mkdir()


def write_times(folder: Path, times: list[Any]) -> None:
    write_csv(folder / TIMES, ["timestamp [ns]"], [[time] for time in times])


pupil("no calibration", r"scene_camera\.json: .*calibration is missing.*no default", remove(CAMERA))
pupil("calibration cut off", r"scene_camera\.json: the file is not valid JSON", cut(CAMERA, 0.5))
pupil(
    "7 coefficients",
    r"0, 4, 5 or 8 distortion coefficients, got 7",
    change_json(CAMERA, dist_coefs=DISTORTION[:7]),
)
pupil("no coefficients", r"'dist_coefs' is missing", change_json(CAMERA, dist_coefs=None))
pupil(
    "focal length zero",
    r"focal length is \[0",
    change_json(CAMERA, camera_matrix=[[0, 0, 31], [0, 60, 31], [0, 0, 1]]),
)
pupil(
    "matrix of 4",
    r"'camera_matrix' holds 4 numbers, expected 9",
    change_json(CAMERA, camera_matrix=[1, 2, 3, 4]),
)
pupil(
    "calibration of another camera",
    r"principal point \(816, 612\) is far off",
    change_json(CAMERA, camera_matrix=[[890, 0, 815.5], [0, 890, 611.5], [0, 0, 1]]),
)
pupil("no video", r"there is no scene video", remove("*.mp4"))
pupil("video cut off", r"\.mp4: the video cannot be read", cut("*.mp4", 0.5))
pupil("video empty", r"\.mp4: the video cannot be read", cut("*.mp4", 0))
pupil(
    "video is a folder",
    r"\.mp4: the scene video is missing",
    video_as_folder,
)
pupil("two videos", r"there are 2 scene videos", lambda p: shutil.copy(the_video(p), p / "b.mp4"))
pupil(
    "times fall",
    r"world_timestamps\.csv: the time does not rise at row 4",
    lambda p: write_times(p, [START_NS, START_NS + 9, START_NS + 5, *frame_times_ns()[3:]]),
)
pupil(
    "times are seconds",
    r"row 2 has the time '1650316509\.5'; write times as whole nanoseconds",
    lambda p: write_times(p, ["1650316509.5"] * 12),
)
pupil(
    "times too long",
    r"row 2 has the time '99999999999999999999'",
    lambda p: write_times(p, ["99999999999999999999"] * 12),
)
pupil(
    "times without column",
    r"column 'timestamp \[ns\]' is missing \(found: time\)",
    lambda p: write_csv(p / TIMES, ["time"], [[1]]),
)
pupil("times without rows", r"a header but no rows", lambda p: write_times(p, []))
pupil("times empty", r"world_timestamps\.csv: the file is empty", cut(TIMES, 0))
pupil(
    "times in UTF-16",
    r"world_timestamps\.csv: the file is not UTF-8",
    write(TIMES, "a", encoding="utf-16"),
)
pupil(
    "far fewer rows than frames",
    r"the video has 12 frames but world_timestamps\.csv 6 rows",
    lambda p: write_times(p, frame_times_ns()[:6]),
)
pupil(
    "far fewer frames than rows",
    r"the video has 5 frames but world_timestamps\.csv 12 rows",
    lambda p: write_video(the_video(p), frame_times_ns()[:5]),
)
pupil(
    "gaze row cut off",
    r"gaze\.csv: row 21 has \d values, the header 7; the file may be cut off",
    cut("gaze.csv", 0.98),
)
pupil(
    "gaze in words",
    r"gaze\.csv: row 2 has 'left' in the column 'gaze x \[px\]'",
    lambda p: write_csv(p / "gaze.csv", ["timestamp [ns]", "gaze x [px]", "gaze y [px]"], [[1, "left", 2]]),
)
pupil(
    "gaze times fall",
    r"gaze\.csv: the time falls back at row 3",
    lambda p: write_csv(p / "gaze.csv", ["timestamp [ns]", "gaze x [px]", "gaze y [px]"], [[2, 1, 1], [1, 1, 1]]),
)
pupil(
    "gaze without pixels",
    r"column 'gaze x \[px\]' is missing",
    lambda p: write_csv(p / "gaze.csv", ["timestamp [ns]"], [[1]]),
)

STAMPS = ["name", "timestamp_ns"]
images("camera cut off", r"camera\.json: the file is not valid JSON", cut("camera.json", 0.5))
images(
    "camera model unknown",
    r"camera\.json: The camera model 'FISH' is unknown",
    change_json("camera.json", model="FISH"),
)
images(
    "camera in OpenCV pixels",
    r"first pixel centre at 0; expected 0\.5",
    change_json("camera.json", pixel_centre=0),
)
images(
    "camera of another size",
    r"f_1\.jpg: the picture is 64x62 but its camera 128x62",
    change_json("camera.json", width=128),
)
images(
    "one image of another size",
    r"f_10\.jpg: the picture is 16x16",
    lambda p: cv2.imwrite(str(p / "f_10.jpg"), picture(16, 16, 0)),
)
images("image is no image", r"f_2\.jpg: the picture does not decode", write("f_2.jpg", b"nothing"))
images(
    "image that is not there is named",
    r"timestamps\.csv: it names gone\.jpg",
    lambda p: write_csv(p / "timestamps.csv", STAMPS, [["gone.jpg", 1]]),
)
images(
    "fewer times than images",
    r"3 images but 1 timestamps; f_2\.jpg has none",
    lambda p: write_csv(p / "timestamps.csv", STAMPS, [["f_1.jpg", 1]]),
)
images(
    "image named twice",
    r"f_1\.jpg is named twice",
    lambda p: write_csv(p / "timestamps.csv", STAMPS, [["f_1.jpg", 1], ["f_1.jpg", 2]]),
)
images(
    "two images at one time",
    r"the timestamps do not rise at frame 1",
    lambda p: write_csv(p / "timestamps.csv", STAMPS, [["f_1.jpg", 1], ["f_2.jpg", 1], ["f_10.jpg", 2]]),
)


@table.case("recording that is a file", r"no known kind of recording: it is a single file; looked for Pupil Cloud")
def _(tmp_path: Path) -> Act:
    (tmp_path / "a.mp4").write_text("x")
    return lambda: open_recording(tmp_path / "a.mp4")


@table.case("recording folder empty", r"no known kind of recording: it holds no files")
def _(tmp_path: Path) -> Act:
    return lambda: open_recording(tmp_path)


@table.case("folder without permission", r"cannot be read \(Permission denied\); check its permissions")
def _(tmp_path: Path) -> Act:
    folder = write_image_folder(tmp_path / "capture")
    (folder / "camera.json").chmod(0)
    if os.access(folder / "camera.json", os.R_OK):
        pytest.skip("this user may read everything")
    return lambda: open_recording(folder)


@pytest.mark.parametrize(("prepare", "sentence"), table.cases)
def test_bad_input_is_refused_with_one_sentence(tmp_path, prepare, sentence):
    check_refused(prepare(tmp_path), sentence)
