"""Section IX, which the paper left for later: the safe range of a tag, and what the number of tags in a room does."""

from __future__ import annotations

import numpy as np

from gazeloc_core.arrays import Bools, Floats
from gazeloc_core.charts.values import Chart, Series
from gazeloc_core.errors import InputError
from gazeloc_core.evaluation.evaluate import match_times
from gazeloc_core.evaluation.truth import read_tum
from gazeloc_core.experiments.finding import Finding, Row
from gazeloc_core.experiments.workspace import Workspace
from gazeloc_core.methods import Method
from gazeloc_core.progress import Report, part
from gazeloc_core.stages import inputs
from gazeloc_core.stages.scan import tag_entry
from gazeloc_core.tag_quality.advice import RoomOptions
from gazeloc_core.tag_quality.charts import advice_maps, quality_maps
from gazeloc_core.tag_quality.counts import TagCountOptions, tag_counts, true_views
from gazeloc_core.tag_quality.remembered import remembered_quality
from gazeloc_core.tag_quality.safe_range import (
    SafeRangeOptions,
    TagQuality,
    is_in_safe_range,
    least_safe_pixels,
    safe_cells,
)

SIZE_M = 0.16
ROOM_M = (4.0, 5.0)
SMALL_GRID = SafeRangeOptions(pixels=(20, 33, 57, 115), angles_deg=(0, 30, 60), repeats=4)


def safe_range(workspace: Workspace, report: Report) -> Finding:
    """Detection rate, pose error and ambiguity against pixels per tag and angle; and what to print for a room."""
    quality = quality_of(workspace, report)
    maps = quality_maps(quality, SIZE_M) | advice_maps(quality, RoomOptions(width_m=ROOM_M[0], length_m=ROOM_M[1]))
    return Finding(text=_range_text(quality), tables={"grid": _grid_rows(quality)}, charts=maps)


def quality_of(workspace: Workspace, report: Report) -> TagQuality:
    """What single tags are worth, on the grid of this run's size."""
    options = SMALL_GRID if workspace.size == "small" else SafeRangeOptions()
    return remembered_quality(workspace.cache, options, report)


def tag_count(workspace: Workspace, report: Report) -> Finding:
    """Detection rate and validity, as section IX defines them, against the number of tags in the room."""
    project = workspace.open_project((Method.TAGS,), part(report, 0, 0.6))
    recording = next(iter(project.settings.recordings))
    size_m, truth = tag_entry(project).size_m, project.recording(recording).truth
    if size_m is None or truth is None:
        raise InputError(f"{recording}: this needs the tag size and a ground truth; give --tag-size and --truth.")
    quality = quality_of(workspace, part(report, 0.6, 1))
    sightings = inputs.load_sightings(project.artifact(recording, "tags").read_arrays())
    corners = inputs.load_corners(project.scan_artifact("corners").read_arrays())
    opened = inputs.load_recording(project, recording)
    times, poses = read_tum(truth)
    rows_of_truth = match_times(opened.timestamp_ns, times)[sightings.frame_index]
    seen = sightings.pick((rows_of_truth >= 0) & np.isin(sightings.tag_id, corners.tag_id))
    at = match_times(opened.timestamp_ns, times)[seen.frame_index]
    camera = inputs.load_undistorted_camera(project, recording)
    pixels, angle = true_views(seen, camera, poses[at], corners, size_m)
    is_safe: Bools = is_in_safe_range(quality, safe_cells(quality, size_m), pixels, angle)
    counts = tag_counts(seen, is_safe, len(opened), corners.tag_id.tolist(), TagCountOptions())
    rows: list[Row] = []
    for count in np.unique(counts.tags).tolist():
        mine = counts.tags == count
        rows.append(
            {
                "tags": count,
                "draws": int(mine.sum()),
                **{f"detection_rate_p{p}": _percentile(counts.detection_rate[mine], p) for p in (10, 50, 90)},
                **{f"validity_p{p}": _percentile(counts.validity[mine], p) for p in (10, 50, 90)},
            }
        )
    chart = Chart(
        "Number of tags (section IX)",
        "tags in the room",
        "share, 10 to 90 % of draws",
        (_rate("detection rate", "detection_rate", rows), _rate("validity", "validity", rows)),
    )
    last, half = rows[-1], rows[len(rows) // 2]
    text = (
        f"With all {last['tags']} tags a frame shows one in {last['detection_rate_p50']:.0%} of the cases, with "
        f"{half['tags']} of them in {half['detection_rate_p50']:.0%} (median over which ones); of the frames that show "
        f"one, {last['validity_p50']:.0%} show it within the safe range."
    )
    return Finding(text=text, tables={"counts": rows}, charts={"counts": chart})


def _rate(label: str, name: str, rows: list[Row]) -> Series:
    columns = (np.array([row[f"{name}_p{p}"] for row in rows], dtype=np.float64) for p in (10, 50, 90))
    low, middle, high = columns
    return Series(label, np.array([row["tags"] for row in rows], dtype=np.float64), middle, low=low, high=high)


def _percentile(values: Floats, percent: float) -> float:
    return float(np.nanpercentile(values, percent)) if np.isfinite(values).any() else float("nan")


def _grid_rows(quality: TagQuality) -> list[Row]:
    safe = safe_cells(quality, SIZE_M)
    return [
        {
            "pixels": float(quality.pixels[i]),
            "angle_deg": float(quality.angle_deg[j]),
            "detection_rate": float(quality.detection_rate[i, j]),
            "position_error_sizes": float(quality.position_error_sizes[i, j]),
            "rotation_error_deg": float(quality.rotation_error_deg[i, j]),
            "ambiguous_share": float(quality.ambiguous_share[i, j]),
            "flipped_share": float(quality.flipped_share[i, j]),
            f"is_safe_at_{SIZE_M:g}_m": bool(safe[i, j]),
        }
        for i, j in np.ndindex(quality.detection_rate.shape)
    ]


def _range_text(quality: TagQuality) -> str:
    least = least_safe_pixels(quality, SIZE_M)
    parts = [
        f"{angle:.0f}°: {pixels:.0f} px" if np.isfinite(pixels) else f"{angle:.0f}°: never"
        for angle, pixels in zip(quality.angle_deg, least, strict=True)
    ]
    return (
        f"A single tag of {100 * SIZE_M:.0f} cm is safe (found in 90 % of the pictures, its pose within 8 cm and 2° in"
        " the mean) from this many pixels on, by the angle between its normal and the line of sight: "
        f"{', '.join(parts)}. Seen straight, a tag's tilt is badly determined; seen from the side it is well. The last "
        "two maps say which size is safe from how far, and how many tags of which size a room needs so that a wearer "
        "sees a safe one."
    )
