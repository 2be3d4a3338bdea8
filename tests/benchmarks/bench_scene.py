"""The sample scene from its files to poses in the room, without its own COLMAP model: accuracy, and time by stage."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
from bench_alignment import bench_icp, bench_keypoints, of_project
from bench_alignment import scene as scene_case

from gazeloc_core import pipeline
from gazeloc_core.arrays import Floats
from gazeloc_core.evaluation.evaluate import evaluate
from gazeloc_core.evaluation.truth import read_tum
from gazeloc_core.gaze import cast_gaze
from gazeloc_core.localize.sfm import localize_sfm
from gazeloc_core.methods import Method
from gazeloc_core.pipeline import stage_named
from gazeloc_core.project import Project
from gazeloc_core.stages import inputs
from gazeloc_core.stages.poses import placed_models
from gazeloc_core.stages.recording import load_keyframes
from gazeloc_core.synthesis.scene_project import scene_settings
from gazeloc_core.trajectory import Trajectory

Row = tuple[str, str, bool]
BUDGET_S = 240.0


def bench_scene(scene: Path, work: Path) -> list[Row]:
    """Run everything on the scene's files and compare with its truth."""
    settings = scene_settings(scene, with_colmap=False)
    project = Project.create(work / "scene", replace(settings))
    times = [time for time in pipeline.run(project) if time.ran]
    total = sum(time.seconds for time in times)
    evaluation = pipeline.evaluate_recording(project, "glasses")
    position, rotation = evaluation.position_m, evaluation.rotation_deg
    share = evaluation.registered / evaluation.keyframes
    rows = [
        (
            "sample scene, method sfm: mean error (<= 1.5 cm, <= 0.25°)",
            f"{100 * position.mean:.2f} cm, {rotation.mean:.3f}°",
            position.mean <= 0.015 and rotation.mean <= 0.25,
        ),
        (
            "sample scene: keyframes registered (>= 95 %)",
            f"{evaluation.registered} of {evaluation.keyframes}",
            share >= 0.95,
        ),
        ("stages on the sample scene, files to poses (<= 240 s)", f"{total:.0f} s", total <= BUDGET_S),
    ]
    stages = [
        (f"    {time.title}", f"{time.seconds:.1f} s, {100 * time.seconds / total:.0f} %", True) for time in times
    ]
    return rows + _between_rows(project, scene, times) + stages + _alignment_rows(project) + _shipped_rows(scene)


def _between_rows(project: Project, scene: Path, times: list[pipeline.StageTime]) -> list[Row]:
    """All frames but the keyframes: tracked as they are now, and the same ones interpolated as without tracking."""
    recording, keyframes = inputs.load_recording(project, "glasses"), load_keyframes(project, "glasses")
    placed = placed_models(project, "glasses", Method.SFM)
    tracked = localize_sfm(recording.timestamp_ns, keyframes, placed)
    before = localize_sfm(recording.timestamp_ns, keyframes, [replace(piece, tracked=None) for piece in placed])
    truth = project.recording("glasses").truth
    assert truth is not None
    errors = {}
    for name, trajectory in (("tracked", tracked), ("interpolated", before)):
        evaluation = evaluate(trajectory, *read_tum(truth))
        of_frame = np.full((2, len(trajectory)), np.nan)
        of_frame[:, evaluation.frame_index] = evaluation.frame_position_m, evaluation.frame_rotation_deg
        errors[name] = of_frame[:, trajectory.status == name]
    (position, rotation), between = errors["tracked"], int((~tracked.is_registered).sum())
    share = len(position) / between
    gaze_m = {name: _gaze_errors_m(project, scene, of) for name, of in (("now", tracked), ("before", before))}
    seconds = sum(time.seconds for time in times if time.title == stage_named("tracking").title)
    per_frame = 1000 * seconds / len(recording)
    return [
        (
            "frames between keyframes: mean error of tracked ones (<= 1.2 cm, <= 0.35°)",
            _spread_text(position, rotation),
            bool(position.mean() <= 0.012 and rotation.mean() <= 0.35),
        ),
        ("    the same frames interpolated, as without tracking", _spread_text(*errors["interpolated"]), True),
        ("frames between keyframes: tracked (>= 95 %)", f"{len(position)} of {between}", share >= 0.95),
        (
            "frames between keyframes: time per frame of the recording, decoded too (<= 60 ms)",
            f"{per_frame:.0f} ms",
            per_frame <= 60,
        ),
        (
            "gaze on the scan against where the wearer looked, by these poses: median (<= 4 cm)",
            "{:.1f} cm, p95 {:.1f} cm".format(*(100 * np.percentile(gaze_m["now"], share) for share in (50, 95))),
            bool(np.median(gaze_m["now"]) <= 0.04),
        ),
        (
            "    by interpolated poses",
            "{:.1f} cm, p95 {:.1f} cm".format(*(100 * np.percentile(gaze_m["before"], share) for share in (50, 95))),
            True,
        ),
    ]


def _gaze_errors_m(project: Project, scene: Path, trajectory: Trajectory) -> Floats:
    """How far hits (M,) are from the true ones, of samples that have both."""
    with (scene / "truth" / "gaze3d.csv").open() as file:
        rows = list(csv.DictReader(file))
    columns = [name for name in rows[0] if name.startswith("hit")]
    truth = {int(row["timestamp [ns]"]): [float(row[name] or "nan") for name in columns] for row in rows}
    gaze = cast_gaze(inputs.load_recording(project, "glasses"), trajectory, inputs.load_raycaster(project))
    known = [i for i in np.flatnonzero(gaze.is_hit) if int(gaze.timestamp_ns[i]) in truth]
    errors = np.linalg.norm(gaze.hit[known] - [truth[int(gaze.timestamp_ns[i])] for i in known], axis=1)
    return errors[np.isfinite(errors)]


def _spread_text(position_m: Floats, rotation_deg: Floats) -> str:
    """Mean, median and 95th percentile."""
    values = [(100 * position_m, "cm", 2), (rotation_deg, "°", 3)]
    text = [
        "/".join(f"{value:.{digits}f}" for value in (of.mean(), np.median(of), np.percentile(of, 95))) + f" {unit}"
        for of, unit, digits in values
    ]
    return f"{', '.join(text)} (mean/median/p95)"


def _shipped_rows(scene: Path) -> list[Row]:
    """Clicked pairs on the plain COLMAP model that the scene brings along, which is less exact than our own."""
    return [(f"on the scene's COLMAP model: {what}", text, ok) for what, text, ok in bench_keypoints(scene_case(scene))]


def _alignment_rows(project: Project) -> list[Row]:
    """Clicked pairs instead of tags, and ICP judged by the tags, on the reconstruction that was just made."""
    bench, tags = of_project(project, "glasses")
    return [*bench_keypoints(bench), *bench_icp(bench, 10, tags)]
