"""Table I: registration by shape alone against clicked keypoints with refinement."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np

from gazeloc_core import pipeline
from gazeloc_core.alignment.alignment import align
from gazeloc_core.alignment.refine import refine
from gazeloc_core.arrays import Floats
from gazeloc_core.errors import GazelocError
from gazeloc_core.experiments.finding import Finding, Row
from gazeloc_core.experiments.workspace import Workspace
from gazeloc_core.localize.global_ import align_global
from gazeloc_core.progress import Report, part
from gazeloc_core.project import Project
from gazeloc_core.stages.case import Case
from gazeloc_core.surfaces.clouds import icp_point_to_point, sample_surface
from gazeloc_core.surfaces.meshing import poisson_surface
from gazeloc_core.transforms import Similarity

KEYPOINTS = 10
NOISE_M = 0.01
PAPER_ICP_M = 0.05
SAMPLES = 100_000

Align = Callable[[Case, int], Similarity]


def table_1(workspace: Workspace, report: Report) -> Finding:
    """Table I on our scenes, and on the ARKitScenes folders that the user has."""
    rows: list[Row] = []
    projects = list(_projects(workspace, part(report, 0, 0.6)))
    draws = 10 if workspace.size == "full" else 2
    for number, (name, project) in enumerate(projects):
        report(0.6 + 0.4 * number / len(projects), f"registering {name}")
        for recording in project.settings.recordings:
            rows += _rows(name, project, recording, draws)
    return Finding(text=_summary(rows, draws), tables={"methods": rows})


def _projects(workspace: Workspace, report: Report) -> Iterator[tuple[str, Project]]:
    if workspace.project_folder is not None:
        yield workspace.project_folder.name, Project.open(workspace.project_folder)
        return
    presets = [preset for preset in workspace.presets if "hard" not in preset]
    for number, preset in enumerate(presets):
        share = part(report, number / len(presets), (number + 1) / len(presets))
        project = workspace.project(preset, (), part(share, 0, 0.4))
        with project.lock():
            pipeline.run(project, until="reconstruction", report=part(share, 0.4, 1))
        yield preset, project
    for folder in workspace.arkitscenes:
        yield folder.name, _arkit_project(workspace, folder)


def _arkit_project(workspace: Workspace, folder: Path) -> Project:
    """An ARKitScenes folder by the paper's protocol: every other frame plays the glasses'."""
    project = workspace.protocol_project(folder)
    with project.lock():
        pipeline.run(project, until="reconstruction")
    return project


def _rows(scene: str, project: Project, recording: str, draws: int) -> list[Row]:
    methods: dict[str, tuple[int, Align]] = {
        "global, scale estimated (paper)": (1, partial(_global, step="icp")),
        "global, then ICP with scale": (1, partial(_global, step="icp with scale")),
        f"{KEYPOINTS} keypoints": (draws, _keypoints),
        f"{KEYPOINTS} keypoints + ICP (paper)": (draws, _keypoints_and_icp),
        f"{KEYPOINTS} keypoints + refinement": (draws, _keypoints_refined),
    }
    rows: list[Row] = []
    try:
        case = Case.of_project(project, recording)
    except GazelocError as error:
        return [{"scene": scene, "recording": recording, "note": str(error)}]
    for method, (times, register) in methods.items():
        row = {"scene": scene, "recording": recording, "method": method, "draws": times}
        try:
            errors: Floats = np.array([case.errors(register(case, seed)) for seed in range(times)])
        except GazelocError as error:
            rows.append(row | {"note": str(error)})
            continue
        position, rotation = errors.mean(axis=0)
        rows.append(row | {"position_cm": 100 * float(position), "rotation_deg": float(rotation)})
    return rows


def _global(case: Case, seed: int, step: str) -> Similarity:
    del seed
    found = align_global(poisson_surface(case.model), case.raycaster.mesh).step(step)
    assert found is not None, "the default options take every step"
    return found.scan_from_sfm


def _keypoints(case: Case, seed: int) -> Similarity:
    return align(case.clicked(KEYPOINTS, NOISE_M, seed)).scan_from_sfm


def _keypoints_and_icp(case: Case, seed: int) -> Similarity:
    samples = sample_surface(case.raycaster.mesh, SAMPLES, seed)
    found = icp_point_to_point(case.model.points, samples, _keypoints(case, seed), within=PAPER_ICP_M)
    return _keypoints(case, seed) if found is None else found.a_from_b


def _keypoints_refined(case: Case, seed: int) -> Similarity:
    pairs = case.clicked(KEYPOINTS, NOISE_M, seed)
    start = align(pairs, model=case.model)
    return refine(start, case.model, case.raycaster, pairs).chosen.scan_from_sfm


def _summary(rows: list[Row], draws: int) -> str:
    def mean(method: str) -> str:
        mine = [row for row in rows if row.get("method") == method and "position_cm" in row]
        if not mine:
            return "nothing"
        position, rotation = (np.mean([row[name] for row in mine]) for name in ("position_cm", "rotation_deg"))
        return f"{position:.1f} cm and {rotation:.2f}°"

    return (
        f"Mean camera errors over the scenes; keypoints are clicked with {100 * NOISE_M:.0f} cm of error on both "
        f"sides, {draws} draws each. By shape alone with the scale estimated, as in the paper: "
        f"{mean('global, scale estimated (paper)')}; with a last ICP that may change the scale: "
        f"{mean('global, then ICP with scale')}. {KEYPOINTS} keypoints: {mean(f'{KEYPOINTS} keypoints')}; with the "
        f"paper's ICP, always taken: {mean(f'{KEYPOINTS} keypoints + ICP (paper)')}; with the refinement that must "
        f"prove itself: {mean(f'{KEYPOINTS} keypoints + refinement')}. The paper: 1.9 to 3.1 m and 25 to 37° by "
        "shape, 1.2 to 3.4 cm and 1.5 to 3.4° with keypoints."
    )
