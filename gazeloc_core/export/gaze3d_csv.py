"""Gaze on the scan as CSV: one row for every gaze sample, empty where there is no ray or no hit; metres, scan axes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gazeloc_core.arrays import Floats
from gazeloc_core.gaze import GazeInScan
from gazeloc_core.storage.export_files import starts_with, write_text_export
from gazeloc_core.surfaces.raycast import NO_FACE

HEADER = (
    "timestamp [ns],origin x [m],origin y [m],origin z [m],direction x,direction y,direction z,"
    "hit x [m],hit y [m],hit z [m],hit distance [m],face id,status,fixation id"
)


def write_gaze3d_csv(gaze: GazeInScan, path: Path, *, overwrite: bool = False) -> list[Path]:
    """Write `path`; the list of files written. `fixation id` is empty outside of fixations.

    Raises:
        InputError: if a file is there that GazeLoc did not write, or the folder cannot be written.
    """
    values = np.column_stack([gaze.origin, gaze.direction, gaze.hit, gaze.distance_m])
    fixations = np.zeros(len(gaze), dtype=np.int64) if gaze.fixation_id is None else gaze.fixation_id
    lines = [HEADER]
    for row in range(len(gaze)):
        cells = [
            str(gaze.timestamp_ns[row]),
            *_numbers(values[row]),
            str(gaze.face[row]) if gaze.face[row] != NO_FACE else "",
            str(gaze.status[row]),
            str(fixations[row]) if fixations[row] > 0 else "",
        ]
        lines.append(",".join(cells))
    return [write_text_export(path, "\n".join(lines) + "\n", starts_with(HEADER), overwrite=overwrite)]


def _numbers(values: Floats) -> list[str]:
    return [f"{value:.6f}" if np.isfinite(value) else "" for value in values]
