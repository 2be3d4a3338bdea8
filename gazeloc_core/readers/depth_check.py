"""The import self-check: does the lidar depth agree with the mesh, seen from the reader's own poses?

A wrong axis convention (a forgotten flip, an inverted pose) puts the two metres apart; a right one, about a centimetre.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gazeloc_core.errors import InputError
from gazeloc_core.scan import RoomScan, ScanFrame
from gazeloc_core.surfaces.raycast import Raycaster

FRAMES_CHECKED = 10
PIXELS_CHECKED = 2000
LARGEST_MEDIAN_M = 0.10
SMALLEST_SHARE_HIT = 0.5


@dataclass(frozen=True)
class DepthAgreement:
    """How lidar depth of high confidence and the mesh agree: median |difference| in metres over rays that hit it.

    `share_hit` is the share of rays that hit the mesh at all, `frames` how many frames were compared (0: no depth).
    """

    median_m: float
    share_hit: float
    frames: int


def depth_agreement(scan: RoomScan, frames_checked: int = FRAMES_CHECKED) -> DepthAgreement:
    """The agreement over frames spread over the scan, at a fixed grid of pixels each.

    Raises:
        InputError: if a depth or confidence picture does not decode.
    """
    frames = [frame for frame in scan.frames if frame.depth_path is not None]
    picked = (
        [frames[i] for i in np.unique(np.linspace(0, len(frames) - 1, frames_checked).astype(int))] if frames else []
    )
    caster = Raycaster(scan.mesh)
    differences = [_differences(frame, caster) for frame in picked]
    used = [difference for difference in differences if len(difference)]
    if not used:
        return DepthAgreement(float("nan"), float("nan"), 0)
    together = np.concatenate(used)
    hit = np.isfinite(together)
    median = float(np.median(together[hit])) if hit.any() else float("inf")
    return DepthAgreement(median, float(hit.mean()), len(used))


def _differences(frame: ScanFrame, caster: Raycaster) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """|mesh - lidar| in metres along the camera's z axis, inf where the ray misses the mesh."""
    depth = frame.read_depth_m()
    camera = frame.camera.scaled(depth.shape[1], depth.shape[0])
    known = np.flatnonzero(np.isfinite(depth).ravel())
    known = known[:: max(1, len(known) // PIXELS_CHECKED)]
    rays = camera.unproject(camera.pixel_centres()[known])
    rays = rays / rays[:, 2:]  # then the distance along a ray is the depth
    directions = rays @ frame.scan_from_camera.rotation.as_matrix().T
    hits = caster.cast(frame.scan_from_camera.translation, directions)
    return np.abs(hits.distance - depth.ravel()[known])


def refuse_disagreement(scan: RoomScan, agreement: DepthAgreement) -> None:
    """Refuse a scan whose depth and mesh lie apart.

    Raises:
        InputError: with the numbers.
    """
    if agreement.frames == 0:
        return
    if agreement.median_m > LARGEST_MEDIAN_M or agreement.share_hit < SMALLEST_SHARE_HIT:
        raise InputError.of(
            scan.path,
            f"lidar depth and mesh disagree: median {agreement.median_m * 100:.1f} cm, "
            f"{agreement.share_hit:.0%} of the rays hit the mesh, over {agreement.frames} frames "
            f"(expected below {LARGEST_MEDIAN_M * 100:.0f} cm and above {SMALLEST_SHARE_HIT:.0%})",
            "the poses have a wrong axis convention or the mesh belongs to another scan; export all files again "
            "together",
        )


def checked_against_depth(scan: RoomScan) -> RoomScan:
    """The scan with a sentence on how its depth and its mesh agree.

    Raises:
        InputError: if they lie apart, or a depth or confidence picture does not decode.
    """
    agreement = depth_agreement(scan)
    refuse_disagreement(scan, agreement)
    if agreement.frames == 0:
        note = "There is no lidar depth of high confidence: the poses could not be checked against the mesh."
    else:
        note = (
            f"Lidar depth and mesh agree to {agreement.median_m * 1000:.1f} mm (median over {agreement.frames} "
            f"frames, {agreement.share_hit:.0%} of the rays hit the mesh)."
        )
    return replace(scan, notes=(*scan.notes, note))
