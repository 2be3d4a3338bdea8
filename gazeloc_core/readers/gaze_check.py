"""Whether a recording's gaze can belong to its frames: their clock, and pixels of their picture."""

from __future__ import annotations

import numpy as np

from gazeloc_core.camera import HALF_PIXEL
from gazeloc_core.errors import InputError
from gazeloc_core.recording import Recording

_NORMALISED_SHARE = 0.98
_FEW_SAMPLES = 5
_OUTSIDE_SHARE = 0.5


def check_gaze(recording: Recording) -> list[str]:
    """Sentences on gaze that does not fit the frames, none where it does or there is none.

    Raises:
        InputError: if the gaze is in shares of the picture, which would be cast through its upper left corner.
    """
    gaze = recording.gaze
    if gaze is None or len(gaze.timestamp_ns) == 0:
        return []
    notes = []
    first, last = int(recording.timestamp_ns[0]), int(recording.timestamp_ns[-1])
    if not ((gaze.timestamp_ns >= first) & (gaze.timestamp_ns <= last)).any():
        apart_s = min(abs(int(gaze.timestamp_ns[0]) - last), abs(first - int(gaze.timestamp_ns[-1]))) / 1e9
        notes.append(
            f"No gaze sample lies between the first and the last frame, they are {apart_s:,.1f} s apart: gaze and "
            "frames have different clocks, and no gaze will be found in the scan."
        )
    pixels = gaze.pixels[np.isfinite(gaze.pixels).all(axis=1)]
    if len(pixels) < _FEW_SAMPLES:
        return notes
    shares = pixels - HALF_PIXEL
    if ((shares >= -0.5) & (shares <= 1.5)).all(axis=1).mean() >= _NORMALISED_SHARE:
        x, y = shares[len(shares) // 2]
        problem = f"the gaze is given in shares of the picture ({x:.3f}, {y:.3f}), not in pixels"
        raise InputError.of(recording.path, problem, "multiply x by the width and y by the height of the scene video")
    outside = 1 - float(recording.camera.contains(pixels).mean())
    if outside > _OUTSIDE_SHARE:
        width, height = recording.camera.width, recording.camera.height
        notes.append(f"{outside:.0%} of the gaze samples lie outside of the picture, which is {width}x{height}.")
    return notes
