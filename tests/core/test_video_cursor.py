"""A cursor in a video gives the very frames that reading each by itself gives, in whatever order they are asked for."""

import numpy as np
import pytest
from tiny_captures import frame_times_ns, write_video

from gazeloc_core.errors import InputError
from gazeloc_core.frames.sources import VideoFrames
from gazeloc_core.frames.video_cursor import VideoCursor, cursor_of


@pytest.fixture
def video(tmp_path):
    write_video(tmp_path / "walk.mp4", frame_times_ns())
    return VideoFrames.open(tmp_path / "walk.mp4")


def test_any_order_gives_the_same_frames(video):
    cursor = VideoCursor(video)
    last = len(video) - 1
    rng = np.random.default_rng(0)
    order = [0, 1, 2, 2, 1, last, last, 0, *rng.integers(0, len(video), 12).tolist()]
    for index in order:
        np.testing.assert_array_equal(cursor.read(index), video.read(index))
    cursor.close()
    np.testing.assert_array_equal(cursor.read(1), video.read(1))


def test_going_on_does_not_search_the_file_anew(video, monkeypatch):
    cursor, seeks = VideoCursor(video), []
    real = VideoCursor._seek
    monkeypatch.setattr(VideoCursor, "_seek", lambda self, index: (seeks.append(index), real(self, index)))
    for index in (2, 3, 5, 4):
        cursor.read(index)
    assert seeks == [2, 4]


def test_a_file_that_went_away_is_a_sentence_and_is_read_again_once_it_is_back(video, tmp_path):
    cursor = VideoCursor(video)
    aside = video.path.rename(tmp_path / "aside.mp4")
    with pytest.raises(InputError, match="cannot be read"):
        cursor.read(2)
    aside.rename(video.path)
    np.testing.assert_array_equal(cursor.read(2), video.read(2))


def test_image_files_need_no_cursor():
    frames = object()
    assert cursor_of(frames) is frames
