"""Whatever is cut off or overwritten in a capture: it opens and reads, or is refused with a sentence. Nothing else."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from tiny_arkitscenes import write_arkitscenes
from tiny_captures import write_colmap, write_image_folder, write_recording, write_scan

from gazeloc_core.errors import GazelocError
from gazeloc_core.readers import open_recording, open_scan
from gazeloc_core.sfm.colmap_io import read_model


def use_scan(folder: Path) -> None:
    for frame in open_scan(folder).frames_with_images:
        frame.read_image()


def use_recording(folder: Path) -> None:
    recording = open_recording(folder)
    for _ in recording.frames.iterate(range(len(recording))):
        pass


CAPTURES = {
    "scan": (write_scan, use_scan),
    "untextured scan": (lambda folder: write_scan(folder, textured=False), use_scan),
    "video": (lambda folder: write_arkitscenes(folder, raw=True, wide=True), use_scan),
    "pupil": (write_recording, use_recording),
    "images": (write_image_folder, use_recording),
    "colmap binary": (write_colmap, read_model),
    "colmap text": (lambda folder: write_colmap(folder, "text"), read_model),
}

LATER_FRAMES = re.compile(r"_0000[23]|_305\.[4-9]")
"""Files of frames that are like those of the first: left alone, to save time."""


def damages(content: bytes) -> list[bytes]:
    rng = np.random.default_rng(len(content))
    cuts = [content[:length] for length in sorted(rng.integers(0, max(len(content), 1), 6))]
    overwritten = []
    for _ in range(4):
        changed = np.frombuffer(content, dtype=np.uint8).copy()
        at = rng.integers(0, len(changed), 3)
        changed[at] = rng.integers(0, 256, 3)
        overwritten.append(changed.tobytes())
    return [*cuts, *overwritten]


def refusal(act: Callable[[], None]) -> str | None:
    """The sentence with which an act is refused, None if it is not."""
    try:
        act()
    except GazelocError as error:
        return str(error)
    return None


@pytest.mark.parametrize("kind", CAPTURES)
def test_damage_never_raises_anything_but_a_sentence(tmp_path, kind):
    write, use = CAPTURES[kind]
    use(write(tmp_path))
    used = refused = 0
    files = [p for p in tmp_path.rglob("*") if p.is_file() and not LATER_FRAMES.search(p.name)]
    for path in sorted(files):
        whole = path.read_bytes()
        for content in damages(whole):
            path.write_bytes(content)
            sentence = refusal(lambda: use(tmp_path))
            if sentence is None:
                used += 1
            else:
                refused += 1
                assert str(tmp_path) in sentence
                assert "\n" not in sentence
        path.write_bytes(whole)
    assert refused > used / 4
