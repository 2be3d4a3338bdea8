"""What a person recognises in several pictures of the chair scan, simulated.

By feature tracks of a reconstruction of all pictures, of the glasses' half and the phone's. Nothing else uses it, and
it knows no pose of ARKit's.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gazeloc_core.arrays import Bools, Floats, Ints
from gazeloc_core.evaluation.protocol import held_out_frames, write_recording
from gazeloc_core.readers import open_recording, open_scan
from gazeloc_core.sfm.reconstruction import reconstruct

LEAST_IN_GLASSES, LEAST_IN_PHONE = 5, 3


@dataclass(frozen=True, eq=False)
class Place:
    """A distinct place in the pictures: where it is roughly (3,), in units of no meaning, and who sees it.

    `glasses` (n,) are frames of the recording and `phone` (m,) of the `frames_with_images` that are left to the scan;
    `glasses_px` (n, 2) and `phone_px` (m, 2) are its pixels in them.
    """

    rough: Floats
    glasses: Ints
    glasses_px: Floats
    phone: Ints
    phone_px: Floats


def find_places(source: Path, work: Path) -> list[Place]:
    """Places that are found to a pixel in enough pictures of either half."""
    scan = open_scan(source, colored=False)
    frames, held = scan.frames_with_images, held_out_frames(scan)
    write_recording(frames, work / "pictures")
    common = open_recording(work / "pictures").camera
    names = [f"{frame.name}.jpg" for frame in frames]
    model, *_ = reconstruct(work / "pictures", names, common, np.arange(len(names)), work / "sfm")
    is_held = np.array([frame in held for frame in frames])
    cameras = [held[len(held) // 2].camera if mine else f.camera for f, mine in zip(frames, is_held, strict=True)]
    from_common = np.array([camera.matrix @ np.linalg.inv(common.matrix) for camera in cameras])
    order = np.argsort(model.observation_point, kind="stable")
    starts = np.searchsorted(model.observation_point[order], np.arange(len(model.points) + 1))
    places = []
    for point in np.flatnonzero(model.point_errors_px < 1.0).tolist():
        rows = order[starts[point] : starts[point + 1]]
        frame = model.frame_indices[model.observation_image[rows]]
        rows, frame = rows[np.argsort(frame)], np.sort(frame)
        pixel = np.column_stack([model.observation_px[rows], np.ones(len(rows))])
        own = np.einsum("nij,nj->ni", from_common[frame], pixel)[:, :2]
        mine = is_held[frame]
        if mine.sum() >= LEAST_IN_GLASSES and (~mine).sum() >= LEAST_IN_PHONE:
            glasses, phone = _counted(frame[mine], is_held), _counted(frame[~mine], ~is_held)
            places.append(Place(model.points[point], glasses, own[mine], phone, own[~mine]))
    return places


def _counted(frames: Ints, half: Bools) -> Ints:
    """The frames as numbers within their half."""
    return np.asarray((np.cumsum(half) - 1)[frames], dtype=np.int64)
