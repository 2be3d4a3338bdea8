"""Stage: the paper's figures 3, 5 and 8 for a recording of the user's own, as charts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.spatial.transform import RigidTransform

from gazeloc_core.arrays import Ints
from gazeloc_core.camera import Camera
from gazeloc_core.charts.chart_file import write_charts
from gazeloc_core.charts.values import Chart, Drawing, Series
from gazeloc_core.errors import GazelocError, InputError
from gazeloc_core.evaluation.keypoint_count import (
    KeypointCountErrors,
    KeypointCountOptions,
    exact_pairs,
    keypoint_count_errors,
)
from gazeloc_core.progress import Report, silent
from gazeloc_core.project import Project
from gazeloc_core.stages import inputs
from gazeloc_core.stages.case import Case
from gazeloc_core.stages.poses import fresh_methods, fresh_trajectory
from gazeloc_core.stages.scan import tag_entry
from gazeloc_core.tag_quality.analysis import PlaceErrors, SolverAnalysis, analyse_solver, tag_place_errors
from gazeloc_core.tag_types import TagSightings


@dataclass(frozen=True, eq=False)
class TagViews:
    """Sightings of one device, the camera of each, and the poses of those frames that are posed, else None."""

    device: str
    sightings: TagSightings
    cameras: list[Camera]
    posed: Ints
    """Rows of the sightings whose frames have a pose."""
    scan_from_camera: RigidTransform | None


def draw_figures(project: Project, recording: str, report: Report = silent) -> dict[str, Drawing]:
    """Every figure that the recording has what it takes for; of each that it has not, a note says why."""
    charts: dict[str, Drawing] = {}
    notes: list[str] = []
    devices: tuple[Callable[[], TagViews], ...] = (
        partial(phone_views, project),
        partial(glasses_views, project, recording),
    )
    for number, views in enumerate(devices):
        report(number / 2, "analysing tag poses")
        try:
            charts |= tag_charts(project, views())
        except GazelocError as error:
            notes.append(str(error))
    report(0.8, "drawing keypoints")
    try:
        charts["Figure 8"] = count_chart(
            tuple(
                count_series(name, count_errors(project, recording, KeypointCountOptions(far_apart=far_apart)))
                for name, far_apart in (("anywhere", False), ("far apart", True))
            )
        )
    except GazelocError as error:
        notes.append(str(error))
    write_charts(project.artifact(recording, "figures"), charts, tuple(notes))
    return charts


def tag_charts(project: Project, views: TagViews) -> dict[str, Drawing]:
    """Figures 3 and 5 of the tag that a device saw most often."""
    analysis, _ = analyse(project, views)
    tag = most_seen(views.sightings)
    return {
        f"Figure 3, {views.device}": size_chart(views, analysis, tag),
        f"Figure 5, {views.device}": error_chart(views, analysis, tag),
        f"Figure 5, {views.device}, angles": angle_chart(views, analysis, tag),
    }


def phone_views(project: Project) -> TagViews:
    """The tags in the phone's posed frames."""
    frames = inputs.load_scan(project).frames_with_images
    sightings = inputs.load_sightings(project.scan_artifact("tags").read_arrays())
    at = sightings.frame_index.tolist()
    poses = RigidTransform.concatenate([frames[i].scan_from_camera for i in at]) if at else None
    return TagViews("phone", sightings, [frames[i].camera for i in at], np.arange(len(at)), poses)


def glasses_views(project: Project, recording: str) -> TagViews:
    """The tags in a recording's undistorted frames, posed by the method that the recording is shown with."""
    camera = inputs.load_undistorted_camera(project, recording)
    sightings = inputs.load_sightings(project.artifact(recording, "tags").read_arrays())
    method = project.method(recording)
    posed, poses = np.zeros(0, dtype=np.int64), None
    if method in fresh_methods(project, recording):
        trajectory = fresh_trajectory(project, recording, method)
        posed = np.flatnonzero(trajectory.has_pose[sightings.frame_index])
        poses = trajectory.poses(sightings.frame_index[posed]) if len(posed) else None
    return TagViews("glasses", sightings, [camera] * len(sightings), posed, poses)


def analyse(project: Project, views: TagViews) -> tuple[SolverAnalysis, PlaceErrors | None]:
    """Equations (1) to (3) for all sightings, and the tags' places against the scan's where frames are posed.

    Raises:
        InputError: if the project names no tag size, or no tag was seen.
    """
    size_m = tag_entry(project).size_m
    if size_m is None:
        raise InputError(f"{project.folder}: a tag's pose needs its size; make the project with --tag-size.")
    if len(views.sightings) == 0:
        raise InputError(f"{project.folder}: no tag was found in the frames of the {views.device}.")
    analysis = analyse_solver(views.sightings, views.cameras, size_m)
    places = None
    if views.scan_from_camera is not None:
        corners = inputs.load_corners(project.scan_artifact("corners").read_arrays())
        cameras = [views.cameras[i] for i in views.posed.tolist()]
        seen = views.sightings.pick(views.posed)
        places = tag_place_errors(seen, cameras, views.scan_from_camera, corners, size_m)
    return analysis, places


def most_seen(sightings: TagSightings) -> int:
    """The id of the tag with most sightings."""
    ids, counts = np.unique(sightings.tag_id, return_counts=True)
    return int(ids[counts.argmax()])


def size_chart(views: TagViews, analysis: SolverAnalysis, tag: int) -> Chart:
    """Figure 3: estimated distance against assumed size, for some frames of one tag."""
    mine = np.flatnonzero(analysis.tag_id == tag)
    chosen = mine[np.linspace(0, len(mine) - 1, min(6, len(mine))).round().astype(int)]
    series = tuple(
        Series(f"frame {analysis.frame_index[i]}", analysis.size_m, analysis.distance_of_size_m[i]) for i in chosen
    )
    return Chart(f"Figure 3, {views.device}, tag {tag}", "assumed tag size [m]", "estimated distance [m]", series)


def error_chart(views: TagViews, analysis: SolverAnalysis, tag: int) -> Chart:
    """Figure 5, upper part: error of the distance by equation (3), and the distance, over the frames of one tag."""
    mine = analysis.tag_id == tag
    frame = analysis.frame_index[mine]
    series = (
        Series("distance error [cm]", frame, 100 * analysis.distance_error_m[mine], "points"),
        Series("estimated distance [m]", frame, analysis.distance_m[mine], "points"),
    )
    return Chart(f"Figure 5, {views.device}, tag {tag}", "frame", "error [cm], distance [m]", series)


def angle_chart(views: TagViews, analysis: SolverAnalysis, tag: int) -> Chart:
    """Figure 5, lower part: the three viewing angles over the frames of one tag."""
    mine = analysis.tag_id == tag
    frame = analysis.frame_index[mine]
    series = tuple(
        Series(f"about {axis}", frame, analysis.euler_deg[mine][:, i], "points") for i, axis in enumerate("xyz")
    )
    return Chart(f"Figure 5, angles, {views.device}, tag {tag}", "frame", "viewing angle [°]", series)


def count_errors(project: Project, recording: str, options: KeypointCountOptions) -> KeypointCountErrors:
    """The errors of one recording's cameras; its truth places the exact keypoints.

    Raises:
        InputError: if the recording has no truth.
        GeometryError: if fewer than three registered frames have one.
    """
    case = Case.of_project(project, recording)
    well = (case.model.track_lengths >= 4) & (case.model.point_errors_px < 1.0)
    exact = exact_pairs(case.model.points[well], case.best)
    return keypoint_count_errors(exact, case.model.sfm_from_camera[case.images], case.scan_from_camera, options)


def count_series(name: str, errors: KeypointCountErrors) -> Series:
    """The median error by the number of keypoints, with the band from 10 to 90 % of the draws, in centimetres."""
    counts, position_m, _ = errors.spread()
    low, middle, high = 100 * position_m.T
    return Series(name, counts.astype(np.float64), middle, low=low, high=high)


def count_chart(series: tuple[Series, ...]) -> Chart:
    """Figure 8."""
    return Chart("Figure 8", "keypoints", "mean camera error [cm], 10 to 90 % of draws", series)
