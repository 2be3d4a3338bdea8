"""Aligned poses as CSV: one row for every frame of the recording, its pose empty where it has none.

Poses are `scan_from_camera` (x right, y down, z forward): the translation is the camera centre on the scan in metres,
the quaternion turns camera axes into scan axes. `status` is how the frame came by it: `registered`, `tracked`,
`tag_only` (measured), `interpolated` (not measured), `rejected` or `none` (no pose).
`mark` and `note` are what people said about the frame, `agreement` (0 to 1) how well it agrees with the scan seen from
its pose, `shift` and `turn` how far off the camera looks, each with its standard deviation.
"""

from __future__ import annotations

import csv
import io
from pathlib import Path

from gazeloc_core.export.frame_notes import HEADINGS, FrameNotes
from gazeloc_core.storage.export_files import starts_with, write_text_export
from gazeloc_core.trajectory import Trajectory

_POSES_HEADER = "timestamp [ns],frame index,status,tx [m],ty [m],tz [m],qw,qx,qy,qz"
"""Files of earlier versions have these columns alone."""
HEADER = ",".join([_POSES_HEADER, *HEADINGS])


def write_poses_csv(
    trajectory: Trajectory, path: Path, *, notes: FrameNotes | None = None, overwrite: bool = False
) -> list[Path]:
    """Write `path`; the list of files written.

    Raises:
        InputError: if a file is there that GazeLoc did not write, or the folder cannot be written.
    """
    notes = notes or FrameNotes()
    text = io.StringIO()
    text.write(f"{HEADER}\n")
    rows = csv.writer(text, lineterminator="\n")
    for index, has_pose in enumerate(trajectory.has_pose):
        pose = [""] * 7
        if has_pose:
            pose = [f"{value:.9f}" for value in (*trajectory.centers[index], *trajectory.wxyz[index])]
        start = [str(trajectory.timestamp_ns[index]), str(index), str(trajectory.status[index])]
        rows.writerow([*start, *pose, *notes.cells(index)])
    return [write_text_export(path, text.getvalue(), starts_with(_POSES_HEADER), overwrite=overwrite)]
