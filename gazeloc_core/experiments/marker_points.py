"""Figure 9: the reconstruction's points under tags, before and after the paper's filtering."""

from __future__ import annotations

import numpy as np

from gazeloc_core.alignment.paper_keypoints import SfmTagCenters, sfm_tag_centers
from gazeloc_core.arrays import Bytes
from gazeloc_core.charts.palette import colors_of_ids
from gazeloc_core.experiments.finding import Finding, Row
from gazeloc_core.experiments.overview import View, look_into, side_by_side, with_points
from gazeloc_core.experiments.workspace import Workspace
from gazeloc_core.methods import Method
from gazeloc_core.progress import Report, part
from gazeloc_core.project import Project
from gazeloc_core.stages import inputs
from gazeloc_core.stages.poses import placed_models

GREY = (120, 120, 120)


def figure_9(workspace: Workspace, report: Report) -> Finding:
    """The sparse points, those under tags (c), and those of them that make the tags' centres (d)."""
    project = workspace.open_project((Method.SFM,), part(report, 0, 0.9))
    recording = next(iter(project.settings.recordings))
    found = marker_points(project, recording)
    placed = placed_models(project, recording, Method.SFM)[0]
    points = placed.scan_from_sfm.apply(placed.model.points)
    room = look_into(inputs.load_mesh(project), inputs.load_scan(project))
    paper = View(np.full_like(room.rgb, 255), room.camera, room.scan_from_camera)
    pictures: list[Bytes] = [with_points(paper, points, placed.model.point_colors).rgb]
    faint = with_points(paper, points[::3], GREY)
    for shown in (np.ones(len(found.point), dtype=np.bool_), found.is_kept):
        pictures.append(with_points(faint, points[found.point[shown]], colors_of_ids(found.point_tag[shown]), 3).rgb)
    labels = ["b: sparse reconstruction", "c: points under tags", "d: after filtering"]
    text = (
        f"{len(found.point)} of {len(points)} points lie under a tag in some frame; the paper's reprojection threshold "
        f"and largest cluster keep {int(found.is_kept.sum())} of them, of {len(found.centers)} tags. Each tag has a "
        "colour of its own."
    )
    return Finding(text=text, tables={"tags": _rows(found)}, pictures={"figure-9": side_by_side(pictures, labels, 3)})


def marker_points(project: Project, recording: str) -> SfmTagCenters:
    """The points under tags of a recording's largest model."""
    return sfm_tag_centers(
        inputs.load_model(project, recording),
        inputs.load_undistorted_camera(project, recording),
        inputs.load_sightings(project.artifact(recording, "tags").read_arrays()),
    )


def _rows(found: SfmTagCenters) -> list[Row]:
    kept = {int(tag): number for number, tag in enumerate(found.centers.tag_id)}
    return [
        {
            "tag": int(tag),
            "points_under_it": int((found.point_tag == tag).sum()),
            "points_kept": int(found.is_kept[found.point_tag == tag].sum()),
            "has_centre": int(tag) in kept,
        }
        for tag in np.unique(found.point_tag).tolist()
    ]
