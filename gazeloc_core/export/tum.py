"""Aligned poses as a TUM trajectory: `timestamp tx ty tz qx qy qz qw`, seconds and metres, `scan_from_camera`.

The format is that of the TUM RGB-D benchmark (Sturm et al., IROS 2012), which evo and most SLAM tools read. Seconds
are written digit by digit from the integer nanoseconds: a double cannot hold a Unix time to the nanosecond. What people
said about a frame is a comment before its line, which readers of the format pass over.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gazeloc_core.export.frame_notes import FrameNotes
from gazeloc_core.storage.export_files import starts_with, write_text_export
from gazeloc_core.trajectory import PoseStatus, Trajectory

HEADER = "# GazeLoc: scan_from_camera; timestamp tx ty tz qx qy qz qw"


@dataclass(frozen=True, kw_only=True)
class TumOptions:
    """Which frames go into a TUM file."""

    registered_only: bool = False
    """Leave interpolated frames out."""


def seconds_text(timestamp_ns: int) -> str:
    """Nanoseconds as seconds with nine decimals, exactly."""
    whole, rest = divmod(abs(int(timestamp_ns)), 10**9)
    return f"{'-' if timestamp_ns < 0 else ''}{whole}.{rest:09d}"


def write_tum(
    trajectory: Trajectory,
    path: Path,
    options: TumOptions | None = None,
    *,
    notes: FrameNotes | None = None,
    overwrite: bool = False,
) -> list[Path]:
    """Write the frames that have a pose to `path`; the list of files written.

    Raises:
        InputError: if a file is there that GazeLoc did not write, or the folder cannot be written.
    """
    wanted = trajectory.has_pose
    if options is not None and options.registered_only:
        wanted = wanted & (trajectory.status != PoseStatus.INTERPOLATED.value)
    notes, lines = notes or FrameNotes(), [HEADER]
    for index in np.flatnonzero(wanted).tolist():
        if said := notes.sentence(index):
            lines.append(f"# frame {index} is {said}")
        w, x, y, z = trajectory.wxyz[index]
        values = " ".join(f"{value:.9f}" for value in (*trajectory.centers[index], x, y, z, w))
        lines.append(f"{seconds_text(int(trajectory.timestamp_ns[index]))} {values}")
    return [write_text_export(path, "\n".join(lines) + "\n", starts_with(HEADER), overwrite=overwrite)]
