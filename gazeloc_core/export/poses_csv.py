"""Aligned poses as CSV: one row for every frame of the recording, its pose empty where it has none.

Poses are `scan_from_camera` (x right, y down, z forward): the translation is the camera centre on the scan in metres,
the quaternion turns camera axes into scan axes.
"""

from __future__ import annotations

from pathlib import Path

from gazeloc_core.export.files import starts_with, write_text_export
from gazeloc_core.trajectory import Trajectory

HEADER = "timestamp [ns],frame index,status,tx [m],ty [m],tz [m],qw,qx,qy,qz"


def write_poses_csv(trajectory: Trajectory, path: Path, *, overwrite: bool = False) -> list[Path]:
    """Write `path`; the list of files written.

    Raises:
        InputError: if a file is there that GazeLoc did not write, or the folder cannot be written.
    """
    lines = [HEADER]
    for index, has_pose in enumerate(trajectory.has_pose):
        pose = [""] * 7
        if has_pose:
            pose = [f"{value:.9f}" for value in (*trajectory.centers[index], *trajectory.wxyz[index])]
        lines.append(",".join([str(trajectory.timestamp_ns[index]), str(index), str(trajectory.status[index]), *pose]))
    return [write_text_export(path, "\n".join(lines) + "\n", starts_with(HEADER), overwrite=overwrite)]
