"""Stage: which tags the scanned room needs for a recording's glasses, as the maps of section IX."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from gazeloc_core.charts.chart_file import write_charts
from gazeloc_core.charts.values import Drawing
from gazeloc_core.errors import InputError
from gazeloc_core.progress import Report, silent
from gazeloc_core.project import Project
from gazeloc_core.scan import RoomScan
from gazeloc_core.stages import inputs
from gazeloc_core.stages.scan import tag_entry
from gazeloc_core.surfaces.viewpoint import up_vector
from gazeloc_core.tag_quality.advice import RoomOptions
from gazeloc_core.tag_quality.charts import advice_maps, quality_maps
from gazeloc_core.tag_quality.remembered import remembered_quality
from gazeloc_core.tag_quality.safe_range import SafeRangeOptions

TITLES = {
    "detection": "Section IX, detection",
    "position": "Section IX, position",
    "rotation": "Section IX, rotation",
    "flipped": "Section IX, wrong pose of two",
    "sizes": "Section IX, tag sizes",
    "rooms": "Section IX, number of tags",
}


def draw_advice(
    project: Project, recording: str, cache: Path, options: SafeRangeOptions | None = None, report: Report = silent
) -> dict[str, Drawing]:
    """The maps for this recording's lens, the project's tag size and a plain room as large as the scan.

    Trying out tags takes minutes the first time for a focal length; what came of it is kept in `cache`. The grid is
    that of `options`, but for its focal length.

    Raises:
        InputError: if the project has no tag size, or the recording cannot be opened.
        Cancelled: when `report` raises it.
    """
    tags = tag_entry(project)
    if tags.size_m is None:
        raise InputError(f"{project.folder}: the maps need the tags' size; make the project with --tag-size.")
    camera = inputs.load_recording(project, recording).camera
    focal_px = round(float(np.mean(camera.focal_px)))  # glasses of one make share what was tried out
    width_m, length_m = floor_size_m(inputs.load_scan(project))
    room = RoomOptions(
        width_m=width_m,
        length_m=length_m,
        focal_px=focal_px,
        view_deg=2 * float(np.degrees(np.arctan(camera.width / 2 / focal_px))),
    )
    options = options or SafeRangeOptions()
    grid = replace(options, focal_px=focal_px, detection=replace(options.detection, family=tags.family))
    quality = remembered_quality(cache, grid, report)
    maps = quality_maps(quality, tags.size_m) | advice_maps(quality, room)
    charts: dict[str, Drawing] = {TITLES[name]: chart for name, chart in maps.items()}
    write_charts(project.artifact(recording, "advice"), charts)
    return charts


def floor_size_m(scan: RoomScan) -> tuple[float, float]:
    """Two lengths of the scan's floor, of the box that holds nearly all of it: scans have crumbs outside the walls."""
    low, high = np.percentile(scan.mesh.vertices, [1, 99], axis=0)
    flat = np.flatnonzero(up_vector(scan.up_axis) == 0)
    first, second = (high - low)[flat].tolist()
    return first, second
