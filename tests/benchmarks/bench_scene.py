"""The sample scene from its files to poses in the room, without its own COLMAP model: accuracy, and time by stage."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from bench_alignment import bench_icp, bench_keypoints, of_project
from bench_alignment import scene as scene_case

from gazeloc_core import pipeline
from gazeloc_core.project import Project
from gazeloc_core.scene_project import scene_settings

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
    return rows + stages + _alignment_rows(project) + _shipped_rows(scene)


def _shipped_rows(scene: Path) -> list[Row]:
    """Clicked pairs on the plain COLMAP model that the scene brings along, which is less exact than our own."""
    return [(f"on the scene's COLMAP model: {what}", text, ok) for what, text, ok in bench_keypoints(scene_case(scene))]


def _alignment_rows(project: Project) -> list[Row]:
    """Clicked pairs instead of tags, and ICP judged by the tags, on the reconstruction that was just made."""
    bench, tags = of_project(project, "glasses")
    return [*bench_keypoints(bench), *bench_icp(bench, 10, tags)]
