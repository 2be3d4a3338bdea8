"""The poses of a recording's frames in the scan, one row for every frame, each with a status.

A pose exists exactly where the status says so; nothing is copied from a neighbour and called localised.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform

from gazeloc_core.arrays import Bools, Floats, Ints, frozen
from gazeloc_core.errors import GeometryError
from gazeloc_core.transforms import rigid_from_wxyz, wxyz_of


class PoseStatus(StrEnum):
    """How a frame came by its pose; the last two have none."""

    REGISTERED = "registered"
    TRACKED = "tracked"
    INTERPOLATED = "interpolated"
    TAG_ONLY = "tag_only"
    REJECTED = "rejected"
    NONE = "none"

    @property
    def has_pose(self) -> bool:
        """Whether a frame of this status has a pose."""
        return self not in (PoseStatus.REJECTED, PoseStatus.NONE)


_MEASURED = (PoseStatus.REGISTERED, PoseStatus.TRACKED, PoseStatus.TAG_ONLY)


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Columns over the N frames of a recording.

    `timestamp_ns` (N,); `status` (N,) of `PoseStatus` values; `is_keyframe` (N,) the frames to be registered;
    `centers` (N, 3) camera centres in the scan in metres and `wxyz` (N, 4) rotations `scan_from_camera`, NaN without
    pose.
    """

    timestamp_ns: Ints
    status: NDArray[Any]
    is_keyframe: Bools
    centers: Floats
    wxyz: Floats

    def __post_init__(self) -> None:
        columns = {
            "timestamp_ns": frozen(self.timestamp_ns, np.int64),
            "status": frozen(self.status, "U16"),
            "is_keyframe": frozen(self.is_keyframe, np.bool_),
            "centers": frozen(self.centers),
            "wxyz": frozen(self.wxyz),
        }
        count = len(columns["timestamp_ns"])
        for name, column in columns.items():
            if len(column) != count:
                raise GeometryError(f"The trajectory has {count} times but {len(column)} rows of {name}.")
            object.__setattr__(self, name, column)
        has_pose = np.isfinite(self.centers).all(axis=1) & np.isfinite(self.wxyz).all(axis=1)
        if (has_pose != self.has_pose).any():
            at = int(np.flatnonzero(has_pose != self.has_pose)[0])
            raise GeometryError(f"Frame {at} has the status {self.status[at]!r}, which its pose contradicts.")

    @classmethod
    def from_poses(
        cls,
        timestamp_ns: Ints,
        status: NDArray[Any],
        is_keyframe: Bools,
        frame_indices: Ints,
        scan_from_camera: RigidTransform | None,
    ) -> Trajectory:
        """The trajectory with poses (K,) at rising `frame_indices` (K,) and none elsewhere."""
        centers, wxyz = np.full((len(timestamp_ns), 3), np.nan), np.full((len(timestamp_ns), 4), np.nan)
        if scan_from_camera is not None and len(frame_indices):
            centers[frame_indices] = scan_from_camera.translation
            wxyz[frame_indices] = wxyz_of(scan_from_camera.rotation)
        return cls(timestamp_ns, status, is_keyframe, centers, wxyz)

    def __len__(self) -> int:
        return len(self.timestamp_ns)

    @property
    def has_pose(self) -> Bools:
        """(N,) whether each frame has a pose, by its status."""
        return np.isin(self.status, [status.value for status in PoseStatus if status.has_pose])

    @property
    def is_registered(self) -> Bools:
        """(N,) whether each frame is an image of the reconstruction, neither tracked from one nor interpolated."""
        return np.asarray(self.status == PoseStatus.REGISTERED.value)

    @property
    def is_localised(self) -> Bools:
        """(N,) whether each frame was localised by what it shows itself: registered, tracked, or by its tags."""
        return np.isin(self.status, [status.value for status in _MEASURED])

    @property
    def localised_keyframes(self) -> Ints:
        """The keyframes (K,) that were localised, which is what views show; all localised frames where none was."""
        keyframes = np.flatnonzero(self.is_localised & self.is_keyframe)
        return keyframes if len(keyframes) else np.flatnonzero(self.is_localised)

    def counts(self) -> dict[str, int]:
        """How many frames there are, and how many of which kind."""
        return {
            "frames": len(self),
            "keyframes": int(self.is_keyframe.sum()),
            "localised": int(self.is_localised.sum()),
            "tracked": int((self.status == PoseStatus.TRACKED.value).sum()),
            "with a pose": int(self.has_pose.sum()),
        }

    def pose(self, index: int) -> RigidTransform | None:
        """`scan_from_camera` of one frame, None where it has no pose."""
        if not PoseStatus(str(self.status[index])).has_pose:
            return None
        return rigid_from_wxyz(self.wxyz[index], self.centers[index])

    def poses(self, indices: Ints | Bools) -> RigidTransform:
        """`scan_from_camera` of several frames that all have a pose."""
        return rigid_from_wxyz(self.wxyz[indices], self.centers[indices])
