"""Figure 6: the reconstruction's surface registered to the scan by shape alone, step by step."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gazeloc_core.arrays import Bytes
from gazeloc_core.errors import GeometryError
from gazeloc_core.experiments.finding import Finding, Row
from gazeloc_core.experiments.overview import View, look_into, side_by_side, with_points
from gazeloc_core.experiments.workspace import Workspace
from gazeloc_core.localize.global_ import GlobalRegistration, align_global
from gazeloc_core.methods import Method
from gazeloc_core.progress import Report, part
from gazeloc_core.scan import Mesh
from gazeloc_core.stages import inputs
from gazeloc_core.stages.case import Case
from gazeloc_core.stages.poses import placed_models
from gazeloc_core.surfaces.glb import Rgb
from gazeloc_core.surfaces.meshing import delaunay_surface, poisson_surface
from gazeloc_core.transforms import Similarity

BLUE: Rgb = (40, 90, 220)
_DRAWN_POINTS = 12_000


def figure_6(workspace: Workspace, report: Report) -> Finding:
    """Both surfaces, the starts and ends of registering them with the scale estimated and given."""
    project = workspace.open_project((Method.SFM,), part(report, 0, 0.5))
    recording = next(iter(project.settings.recordings))
    model, scan_mesh = inputs.load_model(project, recording), inputs.load_raycaster(project).mesh
    room = look_into(inputs.load_mesh(project), inputs.load_scan(project))
    sfm = placed_models(project, recording, Method.SFM)[0].scan_from_sfm
    case = Case.of_project(project, recording) if project.recording(recording).truth is not None else None
    rows: list[Row] = []
    pictures: list[Bytes] = [room.rgb]
    labels = ["a: scan"]
    for name, make in (("poisson", poisson_surface), ("delaunay", delaunay_surface)):
        report(0.5 if name == "poisson" else 0.75, f"{name} surface")
        surface = make(model)
        pictures.append(_alone(room, surface, sfm))
        labels.append(f"b: {name} surface of the reconstruction (placed by sfm)")
        for what, scale in (("d: scale estimated", None), ("e: scale given", sfm.scale)):
            try:
                found = align_global(surface, scan_mesh, scale=scale)
            except GeometryError as error:  # shapes alone may not be enough: that is a finding too
                rows.append({"surface": name, "scale": what[3:], "note": str(error)})
                pictures.append(np.full_like(room.rgb, 255))
                labels.append(f"{name}, {what}: no answer")
                continue
            rows += _rows(name, what[3:], found, case, sfm)
            for label, step in ((f"c: normalised, {what[3:]}", found.step("normalised")), (what, found.step("icp"))):
                if step is not None:
                    pictures.append(_on_scan(room, surface, step.scan_from_sfm))
                    labels.append(f"{name}, {label}")
    return Finding(
        text=_summary(rows), tables={"steps": rows}, pictures={"figure-6": side_by_side(pictures, labels, 3)}
    )


def _alone(room: View, surface: Mesh, placed: Similarity) -> Bytes:
    return _on_scan(replace(room, rgb=np.full_like(room.rgb, 255)), surface, placed, own_colors=True)


def _on_scan(room: View, surface: Mesh, placed: Similarity, own_colors: bool = False) -> Bytes:
    step = max(1, len(surface.vertices) // _DRAWN_POINTS)
    points = placed.apply(surface.vertices[::step])
    colors = surface.colors[::step] if own_colors and surface.colors is not None else BLUE
    return with_points(room, points, colors).rgb


def _rows(surface: str, scale: str, found: GlobalRegistration, case: Case | None, sfm: Similarity) -> list[Row]:
    rows: list[Row] = []
    for step in found.steps:
        row = {
            "surface": surface,
            "scale": scale,
            "step": step.name,
            "fitness": step.fitness,
            "rms_cm": 100 * step.rms_m if np.isfinite(step.rms_m) else None,
            "scale_against_sfm": step.scan_from_sfm.scale / sfm.scale,
        }
        if case is not None:
            position_m, rotation_deg = case.errors(step.scan_from_sfm)
            row |= {"position_cm": 100 * position_m, "rotation_deg": rotation_deg}
        rows.append(row)
    return rows


def _summary(rows: list[Row]) -> str:
    def last(scale: str, step: str) -> str:
        found = [row for row in rows if row["scale"] == scale and row.get("step") == step and "position_cm" in row]
        return " and ".join(f"{row['position_cm']:.1f} cm ({row['surface']})" for row in found) or "no answer"

    return (
        "Two surfaces of the sparse points registered to the scan by shape alone (section VI-A). Mean camera errors "
        f"after the paper's ICP: with the scale estimated {last('scale estimated', 'icp')}, with the scale given "
        f"{last('scale given', 'icp')}. A further ICP that may change the scale, which the paper does not have, ends "
        f"at {last('scale estimated', 'icp with scale')}. `scale_against_sfm` is 1 where the scale is right."
    )
