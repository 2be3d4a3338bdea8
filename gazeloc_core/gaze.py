"""Where in the room a person looked: every gaze sample as a ray from the camera to its first hit on the scan."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gazeloc_core.arrays import Bools, Floats, Ints, frozen
from gazeloc_core.errors import InputError
from gazeloc_core.frames.undistort import unproject_checked
from gazeloc_core.localize.sfm import within_gaps
from gazeloc_core.progress import Report, silent
from gazeloc_core.recording import Gaze, Recording
from gazeloc_core.surfaces.raycast import NO_FACE, Raycaster
from gazeloc_core.trajectory import Trajectory
from gazeloc_core.transforms import interpolate_poses


class GazeStatus(StrEnum):
    """What became of a gaze sample; only a hit has a point on the scan."""

    HIT = "hit"
    MISS = "miss"
    NO_POSE = "no_pose"
    NO_GAZE = "no_gaze"
    NOT_WORN = "not_worn"


@dataclass(frozen=True, kw_only=True)
class GazeOptions:
    """How poses are found for gaze samples, which come several times per frame."""

    max_gap_s: float = 0.2
    """A sample gets a pose only between two frames with poses no further apart than this, in seconds."""
    chunk: int = 20_000
    """Rays that are cast between two reports of progress."""


@dataclass(frozen=True, eq=False)
class GazeInScan:
    """Columns over the M gaze samples of a recording, in the frame `scan` and in metres; NaN where there is none.

    `timestamp_ns` (M,), `origin` (M, 3) of the camera, `direction` (M, 3) unit length, `hit` (M, 3), `distance_m` (M,),
    `face` (M,) the mesh's triangle or -1, `status` (M,) of `GazeStatus` values, `fixation_id` (M,) or None.
    """

    timestamp_ns: Ints
    origin: Floats
    direction: Floats
    hit: Floats
    distance_m: Floats
    face: Ints
    status: NDArray[Any]
    fixation_id: Ints | None = None

    def __post_init__(self) -> None:
        for name in ("origin", "direction", "hit", "distance_m"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        object.__setattr__(self, "timestamp_ns", frozen(self.timestamp_ns, np.int64))
        object.__setattr__(self, "face", frozen(self.face, np.int64))
        object.__setattr__(self, "status", frozen(self.status, "U8"))
        if self.fixation_id is not None:
            object.__setattr__(self, "fixation_id", frozen(self.fixation_id, np.int64))

    def __len__(self) -> int:
        return len(self.timestamp_ns)

    @property
    def is_hit(self) -> Bools:
        """(M,) whether the ray met the scan."""
        return np.asarray(self.status == GazeStatus.HIT.value)

    def counts(self) -> dict[str, int]:
        """How many samples have each status."""
        return {status.value: int((self.status == status.value).sum()) for status in GazeStatus}


def cast_gaze(
    recording: Recording,
    trajectory: Trajectory,
    raycaster: Raycaster,
    options: GazeOptions | None = None,
    report: Report = silent,
) -> GazeInScan:
    """The gaze of `recording` on the scan, through its distorted camera and the poses of `trajectory`.

    The pose of a sample is interpolated between the frames around it, never across a longer gap and never beyond the
    first or last pose.

    Raises:
        InputError: if the recording has no gaze.
    """
    options = options or GazeOptions()
    gaze = recording.gaze
    if gaze is None:
        raise InputError.of(recording.path, "the recording has no gaze", "export it with gaze data")
    rays = unproject_checked(recording.camera, gaze.pixels)
    status, posed = _status_before_casting(gaze, trajectory, rays, options)
    count = len(gaze)
    origin, direction, hit = (np.full((count, 3), np.nan) for _ in range(3))
    distance, face = np.full(count, np.nan), np.full(count, NO_FACE, dtype=np.int64)
    for start in range(0, len(posed), options.chunk):
        report(start / len(posed), f"gaze sample {posed[start]} of {count}")
        rows = posed[start : start + options.chunk]
        origin[rows], direction[rows] = _rays_in_scan(gaze.timestamp_ns[rows], rays[rows], trajectory)
        hits = raycaster.cast(origin[rows], direction[rows])
        hit[rows], face[rows] = raycaster.points(hits), hits.face
        distance[rows] = np.linalg.norm(hit[rows] - origin[rows], axis=1)
        status[rows] = np.where(hits.is_hit, GazeStatus.HIT.value, GazeStatus.MISS.value)
    report(1.0, "gaze on the scan")
    return GazeInScan(gaze.timestamp_ns, origin, direction, hit, distance, face, status, gaze.fixation_id)


def _status_before_casting(
    gaze: Gaze, trajectory: Trajectory, rays: Floats, options: GazeOptions
) -> tuple[NDArray[Any], Ints]:
    """Statuses (M,), final but for the samples at the returned rows, which have a ray and a pose."""
    known = trajectory.timestamp_ns[trajectory.has_pose]
    has_pose = within_gaps(gaze.timestamp_ns, known, options.max_gap_s)
    has_ray = np.isfinite(rays).all(axis=1)
    is_worn = np.ones(len(gaze), dtype=np.bool_) if gaze.worn is None else np.asarray(gaze.worn, dtype=np.bool_)
    status = np.full(len(gaze), GazeStatus.MISS.value, dtype="U8")
    status[~has_pose] = GazeStatus.NO_POSE.value
    status[~has_ray] = GazeStatus.NO_GAZE.value
    status[~is_worn] = GazeStatus.NOT_WORN.value
    return status, np.flatnonzero(has_pose & has_ray & is_worn)


def _rays_in_scan(timestamp_ns: Ints, rays_in_camera: Floats, trajectory: Trajectory) -> tuple[Floats, Floats]:
    known = trajectory.timestamp_ns[trajectory.has_pose]
    # Seconds since the first pose: exact enough in double precision, which nanoseconds since 1970 are not.
    poses = interpolate_poses(
        (known - known[0]) / 1e9, trajectory.poses(trajectory.has_pose), (timestamp_ns - known[0]) / 1e9
    )
    directions = np.einsum("nij,nj->ni", poses.rotation.as_matrix(), rays_in_camera)
    return np.asarray(poses.translation, dtype=np.float64), directions
