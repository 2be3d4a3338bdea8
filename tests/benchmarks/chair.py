"""The real chair scan as scan and recording: every other picture plays the glasses, ARKit's poses are the truth.

The other half of the pictures stays with the phone. What a person recognises in several pictures is simulated by the
feature tracks of a reconstruction of all pictures, which nothing else here uses and which knows no pose of ARKit's.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gazeloc_core.arrays import Floats, Ints
from gazeloc_core.protocol import held_out_frames, write_recording
from gazeloc_core.readers import open_recording, open_scan
from gazeloc_core.sfm import reconstruct

LEAST_IN_GLASSES, LEAST_IN_PHONE = 5, 3


@dataclass(frozen=True, eq=False)
class Place:
    """A distinct place in the pictures: where it is roughly (3,), in units of no meaning, and who sees it.

    `glasses` and `phone` are frames (n,) of the recording and of the pictures that stay in the scan; their pixels are
    (n, 2), those of the phone in its own pictures.
    """

    rough: Floats
    glasses: Ints
    glasses_px: Floats
    phone: Ints
    phone_px: Floats


def find_places(source: Path, work: Path) -> list[Place]:
    """Places that are found to a pixel in enough pictures of either half, by a reconstruction of all pictures."""
    scan = open_scan(source, colored=False)
    frames, held = scan.frames_with_images, held_out_frames(scan)
    write_recording(frames, work / "pictures")
    recording = open_recording(work / "pictures")
    names = sorted(path.name for path in (work / "pictures").glob("*.jpg"))
    model, *_ = reconstruct(work / "pictures", names, recording.camera, np.arange(len(names)), work / "sfm")
    from_common = np.array([frame.camera.matrix for frame in frames]) @ np.linalg.inv(recording.camera.matrix)
    to_held = held[len(held) // 2].camera.matrix @ np.linalg.inv(recording.camera.matrix)  # as the protocol writes them
    order = np.argsort(model.observation_point, kind="stable")
    starts = np.searchsorted(model.observation_point[order], np.arange(len(model.points) + 1))
    places = []
    for point in np.flatnonzero(model.point_errors_px < 1.0).tolist():
        rows = order[starts[point] : starts[point + 1]]
        frame, pixel = model.frame_indices[model.observation_image[rows]], model.observation_px[rows]
        in_time = np.argsort(frame)
        frame, pixel = frame[in_time], np.column_stack([pixel[in_time], np.ones(len(frame))])
        glasses = frame % 2 == 0
        if glasses.sum() >= LEAST_IN_GLASSES and (~glasses).sum() >= LEAST_IN_PHONE:
            in_glasses = pixel[glasses] @ to_held.T
            in_phone = np.einsum("nij,nj->ni", from_common[frame[~glasses]], pixel[~glasses])
            rows_of_half = frame // 2
            places.append(
                Place(
                    model.points[point],
                    rows_of_half[glasses],
                    in_glasses[:, :2],
                    rows_of_half[~glasses],
                    in_phone[:, :2],
                )
            )
    return places
