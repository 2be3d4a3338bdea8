"""Figure 14: the reconstruction from the phone's frames beside that from the glasses', with the same settings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gazeloc_core import pipeline
from gazeloc_core.experiments.finding import Finding, Row
from gazeloc_core.experiments.overview import View, look_into, side_by_side, with_points
from gazeloc_core.experiments.workspace import Workspace
from gazeloc_core.methods import Method
from gazeloc_core.progress import Report, part
from gazeloc_core.stages import inputs
from gazeloc_core.stages.case import Case
from gazeloc_core.stages.recording import load_keyframes


def figure_14(workspace: Workspace, report: Report) -> Finding:
    """Both reconstructions of one room, each placed by its true poses where it has them."""
    project = workspace.open_project((Method.SFM,), part(report, 0, 0.5))
    recording = next(iter(project.settings.recordings))
    phone = workspace.protocol_project(project.settings.scan.path)
    with phone.lock():
        pipeline.run(phone, until="reconstruction", report=part(report, 0.5, 0.9))
    room = look_into(inputs.load_mesh(project), inputs.load_scan(project))
    blank = replace(room, rgb=np.full_like(room.rgb, 255))
    held = next(iter(phone.settings.recordings))
    cases = {"phone": Case.of_project(phone, held), "glasses": Case.of_project(project, recording)}
    keyframes = {"phone": len(load_keyframes(phone, held)), "glasses": len(load_keyframes(project, recording))}
    pictures = [_picture(blank, case) for case in cases.values()]
    rows = [_row(name, case, keyframes[name]) for name, case in cases.items()]
    text = (
        "The same settings on every other frame of the phone and on the keyframes of the glasses. "
        + "; ".join(
            f"{row['device']}: {row['registered']} of {row['keyframes']} frames, {row['points']} points, "
            f"{row['points_per_frame']:.0f} observations per frame, reprojection error {row['error_px']:.2f} px"
            for row in rows
        )
        + "."
    )
    picture = side_by_side([view.rgb for view in pictures], list(cases), 2)
    return Finding(text=text, tables={"reconstructions": rows}, pictures={"figure-14": picture})


def _picture(blank: View, case: Case) -> View:
    return with_points(blank, case.best.apply(case.model.points), case.model.point_colors)


def _row(name: str, case: Case, keyframes: int) -> Row:
    model = case.model
    return {
        "device": name,
        "keyframes": keyframes,
        "registered": len(model),
        "points": len(model.points),
        "points_per_frame": len(model.observation_point) / max(len(model), 1),
        "track_length": float(model.track_lengths.mean()),
        "error_px": float(model.point_errors_px.mean()),
        "position_cm": 100 * case.errors(case.best)[0],
    }
