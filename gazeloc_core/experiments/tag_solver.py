"""Figures 2, 3 and 5, and the third paragraph of section V: how good a tag's pose is, for phone and glasses."""

from __future__ import annotations

import cv2
import numpy as np

from gazeloc_core.arrays import Bytes
from gazeloc_core.charts.values import Chart
from gazeloc_core.experiments.finding import Finding, Row
from gazeloc_core.experiments.overview import side_by_side
from gazeloc_core.experiments.workspace import Workspace
from gazeloc_core.frames.undistort import Undistorter
from gazeloc_core.methods import Method
from gazeloc_core.progress import Report, part
from gazeloc_core.project import Project
from gazeloc_core.stages import inputs
from gazeloc_core.stages.figures import (
    TagViews,
    analyse,
    angle_chart,
    error_chart,
    glasses_views,
    most_seen,
    phone_views,
    size_chart,
)
from gazeloc_core.stages.scan import tag_entry
from gazeloc_core.tag_quality.analysis import PlaceErrors, SolverAnalysis
from gazeloc_core.tags.drawing import draw_tags, drawn_tags

_PICTURE_PX = 480


def tag_solver(workspace: Workspace, report: Report) -> Finding:
    """The analysis for the phone's and for each recording's sightings."""
    project = workspace.open_project((Method.SFM,), part(report, 0, 0.7))
    rows: list[Row] = []
    charts: dict[str, Chart] = {}
    recording = next(iter(project.settings.recordings))
    report(0.8, "analysing tag poses")
    for views in (phone_views(project), glasses_views(project, recording)):
        analysis, places = analyse(project, views)
        tag = most_seen(views.sightings)
        charts[f"figure-3-{views.device}"] = size_chart(views, analysis, tag)
        charts[f"figure-5-{views.device}"] = error_chart(views, analysis, tag)
        charts[f"angles-{views.device}"] = angle_chart(views, analysis, tag)
        rows.append(_row(views, analysis, places))
    pictures = {"figure-2": _ar_views(project, recording)}
    return Finding(text=_summary(rows), tables={"solver": rows}, charts=charts, pictures=pictures)


def _ar_views(project: Project, recording: str) -> Bytes:
    """Figure 2: the frame of either device that shows most tags."""
    size_m = tag_entry(project).size_m
    frames = inputs.load_scan(project).frames_with_images
    on_phone = inputs.load_sightings(project.scan_artifact("tags").read_arrays())
    on_glasses = inputs.load_sightings(project.artifact(recording, "tags").read_arrays())
    phone, glasses = (int(np.bincount(seen.frame_index).argmax()) for seen in (on_phone, on_glasses))
    opened, camera = inputs.load_recording(project, recording), inputs.load_undistorted_camera(project, recording)
    picture = Undistorter(opened.camera, camera).image(opened.frames.read(glasses))
    drawn = [
        draw_tags(picture, drawn_tags(on_glasses, glasses, camera, size_m), camera, size_m),
        draw_tags(
            frames[phone].read_image(),
            drawn_tags(on_phone, phone, frames[phone].camera, size_m),
            frames[phone].camera,
            size_m,
        ),
    ]
    return side_by_side([_of_height(rgb, _PICTURE_PX) for rgb in drawn], ["glasses", "phone"], 2)


def _of_height(rgb: Bytes, height: int) -> Bytes:
    """The picture scaled to a height and padded or cut to 4:3, so that pictures of two devices stand side by side."""
    width = round(height * 4 / 3)
    scale = min(height / rgb.shape[0], width / rgb.shape[1])
    small = cv2.resize(rgb, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    canvas = np.full((height, width, 3), 255, dtype=np.uint8)
    top, left = (height - small.shape[0]) // 2, (width - small.shape[1]) // 2
    canvas[top : top + small.shape[0], left : left + small.shape[1]] = small
    return canvas


def _row(views: TagViews, analysis: SolverAnalysis, places: PlaceErrors | None) -> Row:
    row = {
        "device": views.device,
        "sightings": len(views.sightings),
        "line_residual_mm": 1000 * float(np.nanmax(analysis.line_residual_m)),
        "distance_error_median_cm": 100 * float(np.nanmedian(analysis.distance_error_m)),
        "distance_error_p90_cm": 100 * float(np.nanpercentile(analysis.distance_error_m, 90)),
        "distance_median_m": float(np.nanmedian(analysis.distance_m)),
        "oblique_median_deg": float(np.nanmedian(analysis.oblique_deg)),
    }
    if places is not None and np.isfinite(places.error_m).any():
        row |= {
            "place_error_median_cm": 100 * float(np.nanmedian(places.error_m)),
            "place_error_p90_cm": 100 * float(np.nanpercentile(places.error_m, 90)),
        }
    return row


def _summary(rows: list[Row]) -> str:
    said = "; ".join(
        f"{row['device']}: {row['sightings']} sightings, distance error {row['distance_error_median_cm']:.2f} cm in "
        f"the median and {row['distance_error_p90_cm']:.2f} cm at the 90th percentile"
        for row in rows
    )
    return (
        "The distance of a tag is a linear function of the size that the solver is told (figure 3; the furthest point "
        f"from the line is {max(row['line_residual_mm'] for row in rows):.2g} mm away), so its slope alpha can be held "
        f"against the one that the picture and the pinhole model give by equation (3) for each corner. {said}. Where "
        "poses are known, `place_error` is the distance of the tag's estimated centre from its place on the scan."
    )
