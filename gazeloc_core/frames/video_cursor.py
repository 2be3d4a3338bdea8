"""A place in a video that is read again and again: going on a little costs one frame, not all since the key frame."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import av
import numpy as np

from gazeloc_core.arrays import Bytes
from gazeloc_core.errors import InputError
from gazeloc_core.frames.sources import FrameSource, VideoFrames

AHEAD = 40
"""A frame no further on than this is decoded up to; for others the file is searched anew."""


class VideoCursor:
    """Reads single frames of a video; holds its file open, until `close`. For one thread."""

    def __init__(self, video: VideoFrames):
        self._video = video
        self._index_of_pts = {pts: index for index, pts in enumerate(video.pts)}
        self._container: Any = None
        self._decoded: Iterator[Any] = iter(())
        self._at = len(video)
        """The frame that was read last; nothing is ahead of the end."""

    def read(self, index: int) -> Bytes:
        """One frame (H, W, 3), the very one that `VideoFrames.read` gives.

        Raises:
            InputError: if it does not decode.
        """
        if not self._at < index <= self._at + AHEAD:
            self._seek(index)
        try:
            for frame in self._decoded:
                self._at = self._index_of_pts.get(frame.pts, self._at)
                if self._at == index:
                    return np.asarray(frame.to_ndarray(format="rgb24"))
                if self._at > index:
                    break
        except av.error.FFmpegError as error:
            self.close()
            raise InputError.of(
                self._video.path, f"the video stops decoding ({error.strerror})", "copy or export it again"
            ) from error
        self.close()
        raise InputError.of(self._video.path, f"frame {index} does not decode", "export the recording again")

    def close(self) -> None:
        """Close the file; the next read opens it again."""
        if self._container is not None:
            self._container.close()
            self._container = None
        self._at = len(self._video)

    def _seek(self, index: int) -> None:
        try:
            if self._container is None:
                self._container = av.open(str(self._video.path), metadata_errors="replace")
                self._container.streams.video[0].thread_type = "AUTO"
            stream = self._container.streams.video[0]
            self._container.seek(self._video.pts[index], stream=stream)
            self._decoded = self._container.decode(stream)
            self._at = -1
        except (av.error.FFmpegError, OSError) as error:
            self.close()
            raise InputError.of(self._video.path, f"the video cannot be read ({error})", "copy it again") from error


def cursor_of(frames: FrameSource) -> FrameSource | VideoCursor:
    """What reads single frames of a source fastest: a cursor for a video, for image files the source itself."""
    return VideoCursor(frames) if isinstance(frames, VideoFrames) else frames
