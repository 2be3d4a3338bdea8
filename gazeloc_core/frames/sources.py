"""Sources of a recording's frames: a video file or image files, read by index, undecorated and still distorted."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Protocol

import av
import numpy as np

from gazeloc_core.arrays import Bytes
from gazeloc_core.camera import Camera
from gazeloc_core.errors import InputError
from gazeloc_core.scan import read_image


class FrameSource(Protocol):
    """Frames of a recording by index, each (H, W, 3) RGB uint8."""

    def __len__(self) -> int:
        """How many frames there are."""
        ...

    def read(self, index: int) -> Bytes:
        """One frame; random access, may decode from the last key frame on."""
        ...

    def iterate(self, indices: Sequence[int]) -> Iterator[tuple[int, Bytes]]:
        """The frames of rising `indices`, each with its index, in one pass."""
        ...


@dataclass(frozen=True)
class ImageFrames:
    """Frames that are image files, in order, all of one camera's size."""

    paths: tuple[Path, ...]
    camera: Camera

    def __len__(self) -> int:
        return len(self.paths)

    def read(self, index: int) -> Bytes:
        """One frame.

        Raises:
            InputError: if the file is missing, does not decode or has another size.
        """
        return read_image(self.paths[index], self.camera)

    def iterate(self, indices: Sequence[int]) -> Iterator[tuple[int, Bytes]]:
        """The frames of `indices`, each with its index."""
        for index in indices:
            yield index, self.read(index)


@dataclass(frozen=True)
class VideoFrames:
    """Frames of a video file of variable rate. `pts` are the presentation times of all frames, rising, in stream units.

    Frame i is the i-th in presentation order: never index / fps, the rate varies.
    """

    path: Path
    pts: tuple[int, ...]
    time_base: Fraction

    @classmethod
    def open(cls, path: Path) -> VideoFrames:
        """Index a video's frames without decoding them.

        Raises:
            InputError: if the file is missing, not a video, or has no frames.
        """
        if not path.is_file():
            raise InputError.of(path, "the scene video is missing", "export the recording again")
        try:
            with av.open(str(path), metadata_errors="replace") as container:
                if not container.streams.video:
                    raise InputError.of(path, "the file has no video stream", "export the recording again")
                stream = container.streams.video[0]
                times = [packet.pts for packet in container.demux(stream) if packet.pts is not None and packet.size]
                base = stream.time_base
        except av.error.FFmpegError as error:
            raise InputError.of(
                path, f"the video cannot be read ({error.strerror})", "copy or export it again"
            ) from error
        if not times or base is None:
            raise InputError.of(path, "the video has no frames", "export the recording again")
        return cls(path, tuple(sorted(times)), base)

    def __len__(self) -> int:
        return len(self.pts)

    def read(self, index: int) -> Bytes:
        """One frame, decoded from the key frame before it.

        Raises:
            InputError: if it does not decode.
        """
        for _, image in self.iterate([index]):
            return image
        raise InputError.of(self.path, f"frame {index} does not decode", "export the recording again")

    def iterate(self, indices: Sequence[int]) -> Iterator[tuple[int, Bytes]]:
        """The frames of rising `indices`, each with its index, in one pass of decoding.

        Raises:
            InputError: if a frame that was asked for does not decode.
        """
        if len(indices) == 0:
            return
        index_of_pts = {pts: index for index, pts in enumerate(self.pts)}
        wanted, last = set(indices), max(indices)
        try:
            with av.open(str(self.path), metadata_errors="replace") as container:
                stream = container.streams.video[0]
                stream.thread_type = "AUTO"
                container.seek(self.pts[min(indices)], stream=stream)
                for frame in container.decode(stream):
                    index = index_of_pts.get(frame.pts, -1)
                    if index in wanted:
                        wanted.discard(index)
                        yield index, np.asarray(frame.to_ndarray(format="rgb24"))
                    if index >= last:
                        break
        except av.error.FFmpegError as error:
            raise InputError.of(
                self.path, f"the video stops decoding ({error.strerror})", "copy or export it again"
            ) from error
        if wanted:
            raise InputError.of(
                self.path,
                f"frame {min(wanted)} does not decode; the video is damaged",
                "copy or export it again",
            )
