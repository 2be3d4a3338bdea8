"""AprilTags in pictures (the AprilTag library by pyapriltags; its only home).

The library puts the centre of the first pixel at (0.5, 0.5), which is our convention: corners pass through unchanged
(a test renders tags at known places and looks for a bias). The order of the corners is drawn in `tag_types.py`.

Two things are done to the library's own set-up. Its table for correcting flipped bits grows with the square of their
number: 2 bits of the large families take up to 7 GB, so that the number of bits is chosen by family. And pyapriltags
cuts the sharpening to a whole number, so that its default of 0.25 means none: it is set in the detector itself.
"""

from __future__ import annotations

import threading
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Any, NamedTuple

import cv2
import numpy as np
from pyapriltags import Detector

from gazeloc_core.arrays import Bools, Bytes, Floats
from gazeloc_core.errors import InputError
from gazeloc_core.progress import Report, silent
from gazeloc_core.tag_types import TagSightings


class Family(NamedTuple):
    """A family: how many ids it has, the bits corrected by default, and the memory in MB that 2 bits would take."""

    ids: int
    default_hamming: int
    memory_of_two_mb: int


FAMILIES = {
    # The small families find tags in noise as soon as bits may flip (tag16h5 with 1 bit: one in every picture).
    "tag36h11": Family(587, 2, 35),
    "tag25h9": Family(35, 1, 2),
    "tag16h5": Family(30, 0, 1),
    "tagStandard41h12": Family(2115, 2, 160),
    "tagStandard52h13": Family(48714, 1, 6000),
    "tagCircle21h7": Family(38, 0, 2),
    "tagCircle49h12": Family(65535, 1, 7200),
    "tagCustom48h12": Family(42211, 1, 4400),
}
"""Every family that pyapriltags knows."""

_MUCH_MEMORY_MB = 1000
_one_at_a_time = threading.Lock()  # the library keeps state of its own across detectors


@dataclass(frozen=True, kw_only=True)
class TagOptions:
    """What is searched for, and what counts as found."""

    family: str = "tag36h11"
    """Tag family as printed, e.g. tag36h11 or tagStandard41h12."""
    quad_decimate: float = 1.0
    """Search at 1/this of the resolution: 2 takes a third of the time and loses far tags (85 instead of 95 %)."""
    sharpening: float = 0.25
    """How much tag bits are sharpened before they are read; 0 loses blurred and far tags."""
    min_decision_margin: float = 8.0
    """Least contrast between black and white bits, in grey levels after sharpening."""
    max_hamming: int | None = None
    """Wrong bits that are corrected, 0 to 2; by default what the family bears without finding tags in noise."""
    border_px: float = 2.0
    """Tags with a corner nearer to the picture's edge than this are left out."""
    min_side_px: float = 8.0
    """Tags with a shorter side than this are left out."""
    threads: int = 2
    """Threads of the search."""


def family_of(options: TagOptions) -> Family:
    """The family that the options name.

    Raises:
        InputError: if there is no such family.
    """
    if options.family not in FAMILIES:
        raise InputError(f"The tag family {options.family!r} is unknown; use one of {', '.join(FAMILIES)}.")
    return FAMILIES[options.family]


def hamming_of(options: TagOptions) -> int:
    """How many wrong bits are corrected with these options.

    Raises:
        InputError: if the number is not 0, 1 or 2, or the family is unknown.
    """
    bits = family_of(options).default_hamming if options.max_hamming is None else options.max_hamming
    if bits not in (0, 1, 2):
        raise InputError(f"{bits} wrong bits per tag cannot be corrected; choose 0, 1 or 2.")
    return bits


def memory_note(options: TagOptions) -> str | None:
    """A sentence for the user where these options take much memory, else None."""
    need = family_of(options).memory_of_two_mb
    if hamming_of(options) < 2 or need < _MUCH_MEMORY_MB:
        return None
    return f"{options.family} with 2 corrected bits takes about {need / 1000:.1f} GB of memory; 1 bit takes 0.2 GB."


class TagDetector:
    """Finds the tags of one family, one picture at a time. Keep it: making it takes up to 0.3 s (2 bits: 14 s)."""

    def __init__(self, options: TagOptions | None = None):
        self.options = options or TagOptions()
        bits = hamming_of(self.options)
        if not 1 <= self.options.quad_decimate <= 8:
            raise InputError(f"The tag search cannot decimate by {self.options.quad_decimate}; choose 1 to 8.")
        self._detector: Any = Detector(
            families="", nthreads=self.options.threads, quad_decimate=self.options.quad_decimate
        )
        native, library = self._detector.tag_detector_ptr, self._detector.libc
        family = getattr(library, f"{self.options.family}_create")()
        self._detector.tag_families[self.options.family] = family  # so that it is freed with the detector
        library.apriltag_detector_add_family_bits(native, family, bits)
        native.contents.decode_sharpening = float(self.options.sharpening)

    def __enter__(self) -> TagDetector:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._detector = None  # frees the library's memory

    def detect(self, image: Bytes, frame_index: int = 0) -> TagSightings:
        """The tags in one picture, (H, W, 3) RGB or (H, W) grey, as sightings of `frame_index`, by rising id.

        An id that is seen twice in one picture is ambiguous and left out, unless one of the two lies on the other.
        """
        grey = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
        with _one_at_a_time:
            found = self._detector.detect(np.ascontiguousarray(grey))
        ids = np.array([tag.tag_id for tag in found], dtype=np.int64)
        corners = np.array([tag.corners for tag in found]).reshape(-1, 4, 2)
        margin = np.array([tag.decision_margin for tag in found], dtype=np.float64)
        keep = (margin >= self.options.min_decision_margin) & self._is_well_seen(corners, grey.shape)
        kept = _without_duplicates(ids, corners, margin, np.flatnonzero(keep))
        return TagSightings(np.full(len(kept), frame_index), ids[kept], corners[kept], margin[kept])

    def _is_well_seen(self, corners: Floats, shape: tuple[int, ...]) -> Bools:
        """(S,) whether corners (S, 4, 2) lie clear of the picture's edge and far enough from each other."""
        border = self.options.border_px
        inside = (corners >= border) & (corners <= np.array([shape[1], shape[0]]) - border)
        sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        return np.asarray(inside.all(axis=(1, 2)) & (sides.min(axis=1) >= self.options.min_side_px))


def _without_duplicates(ids: Any, corners: Floats, margin: Floats, candidates: Any) -> list[int]:
    """The candidates by rising id, one per id: the clearer of two that overlap, none of two in different places."""
    kept: list[int] = []
    for tag_id in np.unique(ids[candidates]):
        same = candidates[ids[candidates] == tag_id]
        best = int(same[margin[same].argmax()])
        centres = corners[same].mean(axis=1)
        reach = np.linalg.norm(corners[best] - corners[best].mean(axis=0), axis=1).max()
        if (np.linalg.norm(centres - corners[best].mean(axis=0), axis=1) <= reach).all():
            kept.append(best)
    return kept


def join_sightings(parts: Sequence[TagSightings]) -> TagSightings:
    """All sightings of several sets, in their order."""
    if not parts:
        return TagSightings(np.empty(0, np.int64), np.empty(0, np.int64), np.empty((0, 4, 2)), np.empty(0))
    return TagSightings(
        np.concatenate([part.frame_index for part in parts]),
        np.concatenate([part.tag_id for part in parts]),
        np.concatenate([part.corners_px for part in parts]),
        np.concatenate([part.decision_margin for part in parts]),
    )


def detect_tags(
    frames: Iterable[tuple[int, Bytes]], count: int, options: TagOptions | None = None, report: Report = silent
) -> TagSightings:
    """The tags in a stream of `count` frames, each given with its index; one frame is in memory at a time.

    Raises:
        InputError: if the options name an unknown family or impossible values.
        Cancelled: when `report` raises it.
    """
    options = options or TagOptions()
    report(0.0, memory_note(options) or f"Searching {options.family} in {count} frames")
    parts: list[TagSightings] = []
    with TagDetector(options) as detector:
        for done, (index, image) in enumerate(frames, start=1):
            parts.append(detector.detect(image, index))
            report(done / max(count, done), f"Searched {done} of {count} frames for tags")
    return join_sightings(parts)
