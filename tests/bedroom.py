"""The real bedroom: how many of the tags on its hand-made list are found, for the test and the benchmark."""

from __future__ import annotations

import time
from pathlib import Path
from typing import NamedTuple

import cv2

from gazeloc_core.tags.detection import TagDetector, TagOptions


class Found(NamedTuple):
    """Sightings `found` of those `listed`, `false` ones, the pictures, and the time per picture."""

    found: int
    listed: int
    false: int
    pictures: int
    ms_per_picture: float

    @property
    def recall(self) -> float:
        """The share of the listed sightings that was found."""
        return self.found / self.listed


def search_bedroom(room: Path, options: TagOptions | None = None) -> Found:
    """Search every picture of the list, by default at the shipped settings."""
    lists = [line.split() for line in (room / "visible_tags.txt").read_text().splitlines() if line.strip()]
    found = false = listed = 0
    seconds = 0.0
    with TagDetector(options) as detector:
        for name, *ids in lists:
            image = cv2.cvtColor(cv2.imread(str(room / "images" / name)), cv2.COLOR_BGR2RGB)
            start = time.perf_counter()
            seen = set(detector.detect(image).tag_id.tolist())
            seconds += time.perf_counter() - start
            expected = {int(i) for i in ids}
            found, false, listed = found + len(seen & expected), false + len(seen - expected), listed + len(expected)
    return Found(found, listed, false, len(lists), 1000 * seconds / len(lists))
