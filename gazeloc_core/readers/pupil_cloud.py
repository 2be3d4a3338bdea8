"""Pupil Cloud's "Timeseries Data + Scene Video" export of Pupil Invisible and Neon, as a recording."""

from __future__ import annotations

from pathlib import Path

import av
import numpy as np

from gazeloc_core.arrays import Floats, Ints
from gazeloc_core.errors import InputError
from gazeloc_core.frames.sources import VideoFrames
from gazeloc_core.readers.pupil_files import TIME, read_gaze, read_scene_camera
from gazeloc_core.recording import Recording
from gazeloc_core.storage.user_files import nanoseconds_of, read_csv

FORMAT = "Pupil Cloud export"
TIMES_FILE, CAMERA_FILE, GAZE_FILE = "world_timestamps.csv", "scene_camera.json", "gaze.csv"
LARGEST_SHARE_LOST = 0.02
SMALLEST_LOSS = 3
DISTINCT = 4.0
"""How many times worse the second best way to line up video and times must be for the best to be unambiguous."""


def recognise(path: Path) -> str | None:
    """Why this is a Pupil Cloud export, or None."""
    if path.is_dir() and (path / TIMES_FILE).is_file():
        return f"it holds {TIMES_FILE}"
    return None


def read(path: Path) -> Recording:
    """The recording with its distorted camera and gaze.

    Raises:
        InputError: for whatever is missing or does not fit together.
    """
    if not (path / CAMERA_FILE).is_file():
        raise InputError.of(
            path / CAMERA_FILE, "the scene camera's calibration is missing", "export it too; no default is ever used"
        )
    video = _the_video(path)
    frames = VideoFrames.open(video)
    camera = read_scene_camera(path / CAMERA_FILE, _video_size(video))
    times = np.array(nanoseconds_of(path / TIMES_FILE, read_csv(path / TIMES_FILE, (TIME,))[TIME]), dtype=np.int64)
    if (np.diff(times) <= 0).any():
        row = int(np.flatnonzero(np.diff(times) <= 0)[0]) + 3
        raise InputError.of(path / TIMES_FILE, f"the time does not rise at row {row}", "export the recording again")
    notes = []
    if len(frames) != len(times):
        count, rows = len(frames), len(times)
        frames, times = _matched_by_time(path, frames, times)
        notes.append(
            f"The video has {count} frames but {TIMES_FILE} {rows} rows; {len(times)} frames were matched by their "
            "presentation times."
        )
    gaze = read_gaze(path / GAZE_FILE) if (path / GAZE_FILE).is_file() else None
    if gaze is None:
        notes.append(f"There is no {GAZE_FILE}: cameras can be localised, gaze cannot.")
    return Recording(path, FORMAT, camera, times, frames, gaze, tuple(notes))


def _the_video(path: Path) -> Path:
    videos = sorted(p for p in path.iterdir() if p.suffix.lower() == ".mp4" and not p.name.startswith("."))
    if not videos:
        raise InputError.of(path, "there is no scene video (*.mp4)", 'export "Timeseries Data + Scene Video"')
    if len(videos) > 1:
        names = ", ".join(video.name for video in videos)
        raise InputError.of(
            path,
            f"there are {len(videos)} scene videos ({names}); a recording is one section",
            "put each video with its rows of the CSV files into a folder of its own",
        )
    return videos[0]


def _video_size(path: Path) -> tuple[int, int]:
    with av.open(str(path), metadata_errors="replace") as container:
        context = container.streams.video[0].codec_context
        return int(context.width), int(context.height)


def _matched_by_time(path: Path, frames: VideoFrames, times: Ints) -> tuple[VideoFrames, Ints]:
    """Video frames and rows paired by the rhythm of their times, where it leaves one way to do so.

    The video's clock starts at 0, so how it lies on the rows is unknown: every way to line up its start with a row
    (or the first row with a frame) is tried, and judged by how far off the worst pair is.
    """
    difference = abs(len(frames) - len(times))
    if difference > max(SMALLEST_LOSS, LARGEST_SHARE_LOST * len(times)):
        raise _mismatch(path, frames, times, "too many to tell which are missing")
    in_video = np.array(frames.pts, dtype=np.float64) * float(frames.time_base)
    in_rows = (times - times[0]) / 1e9
    half_frame = 0.5 * float(np.median(np.diff(in_rows))) if len(in_rows) > 1 else 0.0
    video_is_short = len(frames) < len(times)
    few, many = (in_video, in_rows) if video_is_short else (in_rows, in_video)
    tries = [_pairs(few, many, first) for first in range(difference + 1)]
    order = np.argsort([error for error, _ in tries])
    error, index = tries[order[0]]
    rival = next((tries[i][0] for i in order[1:] if not np.array_equal(tries[i][1], index)), np.inf)
    if error > half_frame or len(np.unique(index)) != len(few):
        raise _mismatch(path, frames, times, f"they lie up to {error * 1000:.0f} ms apart")
    if rival < DISTINCT * error + 1e-3:
        raise _mismatch(path, frames, times, "their times fit in several ways")
    if video_is_short:
        return frames, times[index]
    return VideoFrames(frames.path, tuple(frames.pts[i] for i in index), frames.time_base), times


def _pairs(few: Floats, many: Floats, first: int) -> tuple[float, Ints]:
    """For the start of `few` laid on `many[first]`: the largest gap in seconds, and each one's nearest in `many`."""
    shifted = few - few[0] + many[first]
    after = np.clip(np.searchsorted(many, shifted), 1, len(many) - 1)
    nearest = np.where(shifted - many[after - 1] <= many[after] - shifted, after - 1, after)
    return float(np.abs(many[nearest] - shifted).max()), nearest.astype(np.int64)


def _mismatch(path: Path, frames: VideoFrames, times: Ints, why: str) -> InputError:
    return InputError.of(
        path,
        f"the video has {len(frames)} frames but {TIMES_FILE} {len(times)} rows, {why}",
        "export the recording again",
    )
