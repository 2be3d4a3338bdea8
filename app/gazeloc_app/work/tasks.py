"""The app's long work, as functions for the worker process (jobs.py): each calls the pipeline and says how it went."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gazeloc_app.state import Level
from gazeloc_app.work.outcome import Outcome
from gazeloc_core import pipeline
from gazeloc_core.charts.chart_file import read_charts
from gazeloc_core.methods import Method
from gazeloc_core.progress import Report, part
from gazeloc_core.project import Project
from gazeloc_core.stages import advice, figures, registration
from gazeloc_core.storage.user_cache import user_cache

_LEVELS = {"good": Level.INFO, "warning": Level.WARNING, "bad": Level.ERROR}


def run_all(folder: Path, report: Report, *, recording: str, method: Method = Method.SFM) -> Outcome:
    """Every stage of a method that is missing or stale, up to the gaze in the room."""
    project = Project.open(folder)
    times = pipeline.run(project, method=method, recording=recording, report=report)
    chosen = project.settings.chosen.get(recording)
    seconds = sum(time.seconds for time in times)
    return Outcome(
        f"Everything for the method {method} is up to date ({seconds:.0f} s).",
        alignment=chosen.alignment if chosen else None,
        by_person=bool(chosen and chosen.by_person),
    )


def color_scan(folder: Path, report: Report) -> Outcome:
    """The colours of a scan whose file has none."""
    pipeline.run_stage(Project.open(folder), pipeline.stage_named("colors", of_scan=True), None, report)
    return Outcome("The scan's file has no colours; they were taken from the phone's frames.")


def reconstruct(folder: Path, report: Report, *, recording: str) -> Outcome:
    """The stages up to the reconstruction and its tags: what clicking needs."""
    project = Project.open(folder)
    pipeline.run(project, recording=recording, until="corners", report=report)
    return Outcome("The reconstruction is there; click keypoints, or align by the tags.")


def align(folder: Path, report: Report, *, recording: str) -> Outcome:
    """Fit the keypoints, after whatever is missing for that."""
    project = Project.open(folder)
    pipeline.run(project, recording=recording, until="corners", report=part(report, 0, 0.9))
    alignment = registration.align_keypoints(project, recording, report=part(report, 0.9, 1))
    worst = alignment.evidence.worst_level
    residual = alignment.evidence.residual_rms_m
    text = f"Aligned: keypoints fit to {100 * residual:.1f} cm (RMS)." if residual is not None else "Aligned."
    if worst != "good":
        text += " " + next(verdict.text for verdict in alignment.verdicts if verdict.level == worst)
    return Outcome(text, _LEVELS[worst], alignment=alignment.key, by_person=True)


def refine(folder: Path, report: Report, *, recording: str, start: str) -> Outcome:
    """ICP from the alignment in force; put in force only if the evidence says that it is better."""
    project = Project.open(folder)
    refinement = registration.refine_alignment(project, recording, start=start, report=report)
    why = refinement.reason.partition(": ")[2]
    if refinement.accepted:
        return Outcome(f"Refined with ICP: {why}", alignment=refinement.chosen.key, by_person=True)
    return Outcome(f"ICP was refused: {why}", Level.WARNING)


def export(folder: Path, report: Report, *, recording: str, formats: tuple[str, ...], output: str) -> Outcome:
    """The poses in the formats asked for, each in a folder of its own below `output`."""
    project = Project.open(folder)
    pipeline.run_after_choice(project, recording, project.method(recording), part(report, 0, 0.1))
    files = 0
    for position, format in enumerate(formats):
        share = part(report, 0.1 + 0.9 * position / len(formats), 0.1 + 0.9 * (position + 1) / len(formats))
        target = Path(output).expanduser() / format
        files += len(pipeline.export(project, format=format, output=target, recording=recording, report=share))
    return Outcome(f"{files} files were written to {output}. Exported frames show people: treat them with care.")


def score_frames(folder: Path, report: Report, *, recording: str, method: Method = Method.SFM) -> Outcome:
    """How well each frame agrees with the render of the scan from its pose, after the poses of what is chosen."""
    project = Project.open(folder)
    score = pipeline.score(project, recording, method, report).known
    if not len(score):
        return Outcome("No frame could be scored: none has a pose and enough of the scan in view.", Level.WARNING)
    return Outcome(f"{len(score)} frames were scored; the median agreement is {np.median(score):.2f}.")


def draw_figures(folder: Path, report: Report, *, recording: str) -> Outcome:
    """The paper's figures for this recording."""
    project = Project.open(folder)
    charts = figures.draw_figures(project, recording, report)
    if not charts:
        _, notes = read_charts(project.artifact(recording, "figures"))
        return Outcome("There is nothing to draw: " + " ".join(notes), Level.WARNING)
    return Outcome(f"{len(charts)} figures were drawn.")


def draw_advice(folder: Path, report: Report, *, recording: str) -> Outcome:
    """The maps that say which tags, and how many, the scanned room needs."""
    advice.draw_advice(Project.open(folder), recording, user_cache(), report=report)
    return Outcome("The maps of section IX are drawn for this recording's lens, tag size and room.")
