"""Runs the stages that are missing or stale, and says how all stand. Command line, app and tests call this."""

from __future__ import annotations

import time
from collections.abc import Iterator, Set
from dataclasses import dataclass

from gazeloc_core.errors import Cancelled, GazelocError, InputError
from gazeloc_core.gaze import GazeInScan
from gazeloc_core.methods import Method
from gazeloc_core.progress import Report, part, silent
from gazeloc_core.project import Project
from gazeloc_core.stage_list import SCORES, STAGES, Stage, stage_named
from gazeloc_core.stages.evaluation import evaluate_project, evaluate_recording, verdicts
from gazeloc_core.stages.exports import FORMATS, export
from gazeloc_core.stages.gaze import fresh_gaze
from gazeloc_core.stages.poses import fresh_trajectory, methods_with_poses
from gazeloc_core.stages.scores import FrameScores, load_scores
from gazeloc_core.storage.artifacts import State
from gazeloc_core.trajectory import Trajectory

__all__ = [
    "FORMATS",
    "SCORES",
    "STAGES",
    "evaluate_project",
    "evaluate_recording",
    "export",
    "gaze",
    "run",
    "run_after_choice",
    "run_stage",
    "score",
    "stage_named",
    "stamps",
    "statuses",
    "trajectory",
    "verdicts",
]


@dataclass(frozen=True)
class StageStatus:
    """How one stage of a project stands. `recording` is None for stages of the scan, `method` for shared stages."""

    recording: str | None
    method: str | None
    stage: str
    title: str
    state: State
    reason: str


def statuses(project: Project, only: str | None = None, method: Method | None = None) -> list[StageStatus]:
    """How every stage of the scan and of each recording (or one) stands. Opens no video and runs nothing.

    Stages of one method, by default of that which a recording is shown with and of all that have run on it. A stage
    whose inputs are missing is missing itself; one whose inputs are stale is stale.
    """
    names = _recordings(project, only)
    used = {name: {method} if method else {project.method(name), *methods_with_poses(project, name)} for name in names}
    by_any = frozenset[Method]().union(*used.values()) or {Method.SFM}
    found = [_status(project, stage, None) for stage in _needed(project, by_any) if stage.of_scan]
    for name in names:
        found += [_status(project, stage, name) for stage in _needed(project, used[name]) if not stage.of_scan]
    return found


def stamps(project: Project, recording: str, method: Method) -> tuple[object, ...]:
    """Differs once a stage of a method has ended, well or not; a hundred times as quick as `statuses`."""
    return tuple(stage.artifact(project, recording).stamp() for stage in STAGES if method in stage.methods)


def _needed(project: Project, methods: Set[Method]) -> Iterator[Stage]:
    return (stage for stage in STAGES if stage.methods & methods and stage.is_needed(project))


def _status(project: Project, stage: Stage, name: str | None) -> StageStatus:
    artifact = stage.artifact(project, name or "")
    try:
        state, reason = artifact.state(stage.inputs(project, name or ""))
    except InputError as error:
        state, reason = (State.STALE if artifact.exists else State.MISSING), str(error)
    except GazelocError:  # an earlier stage has no result yet
        state, reason = (State.STALE if artifact.exists else State.MISSING), "waits for an earlier stage"
    return StageStatus(name, stage.of_method, stage.name, stage.title, state, reason)


@dataclass(frozen=True)
class StageTime:
    """How long a stage took just now; `ran` is False where its result was fresh already."""

    recording: str | None
    title: str
    seconds: float
    ran: bool


def run(
    project: Project,
    *,
    method: Method = Method.SFM,
    recording: str | None = None,
    until: str | None = None,
    report: Report = silent,
) -> list[StageTime]:
    """Run every stage of a method that is missing or stale, for all recordings or one, up to the stage `until`.

    Puts the outcome in force (`registration.choose`) unless a person chose an alignment. The caller holds the lock.

    Raises:
        GazelocError: what a stage raised; its sentence is kept in the project, what was there before stays.
    """
    if method.needs_tags and project.settings.tags is None:
        raise InputError(
            f"{project.folder}: the method {method} needs tags, and the project names no tag family; make it anew with "
            "--tag-family, or use the method sfm with clicked keypoints."
        )
    todo = list(_stages_of(project, method, recording, until))
    total = sum(stage.weight for stage, _ in todo)
    done, times = 0.0, []
    for stage, name in todo:
        share = part(report, done / total, (done + stage.weight) / total)
        times.append(run_stage(project, stage, name, share))
        done += stage.weight
    report(1.0, "done")
    return times


def run_after_choice(project: Project, recording: str, method: Method, report: Report = silent) -> None:
    """Run what follows a choice that a person made in the app: poses and gaze, and for `sfm` smaller pieces and the
    frames between keyframes."""
    names = ("pieces", "tracking", "trajectory", "gaze") if method is Method.SFM else ("trajectory", "gaze")
    stages = [stage for stage in (stage_named(name, method=method) for name in names) if stage.is_needed(project)]
    total, done = sum(stage.weight for stage in stages), 0.0
    for stage in stages:
        run_stage(project, stage, recording, part(report, done / total, (done + stage.weight) / total))
        done += stage.weight


def trajectory(project: Project, recording: str, method: Method | None = None) -> Trajectory:
    """The poses of all frames of a recording in the scan; by the method that it is shown with unless one is named.

    Raises:
        InputError: if there is no recording of this name.
        ProjectError: if the method has not run yet, or on what was there before.
    """
    project.recording(recording)
    return fresh_trajectory(project, recording, method or project.method(recording))


def gaze(project: Project, recording: str, method: Method | None = None) -> GazeInScan | None:
    """Every gaze sample of a recording as a ray in the scan and its hit; None for a recording without gaze.

    Raises:
        InputError: if there is no recording of this name.
        ProjectError: if the method has not run yet, or on what was there before.
    """
    project.recording(recording)
    return fresh_gaze(project, recording, method or project.method(recording))


def score(project: Project, recording: str, method: Method = Method.SFM, report: Report = silent) -> FrameScores:
    """Score every frame that has a pose by a method, after the poses of what is chosen; see `stages.scores`.

    Raises:
        GazelocError: what a stage raised, as where the recording was not run yet.
    """
    run_after_choice(project, recording, method, part(report, 0, 0.05))
    stage = SCORES[method]
    run_stage(project, stage, recording, part(report, 0.05, 1))
    frames = project.result(recording, method, "trajectory").header().stats["frames"]
    return load_scores(stage.artifact(project, recording), frames)


def run_stage(project: Project, stage: Stage, name: str | None, report: Report = silent) -> StageTime:
    """Run one stage if it is not fresh, and remember its sentence if it fails."""
    artifact = stage.artifact(project, name or "")
    before = stage.inputs(project, name or "")
    if artifact.state(before)[0] is State.FRESH:
        report(1.0, f"{stage.title}: already done")
        return StageTime(name, stage.title, 0.0, ran=False)
    started = time.monotonic()
    report(0.0, stage.title)
    try:
        stage.run(project, name or "", lambda fraction, text="", /: report(fraction, f"{stage.title}: {text}"))
    except Cancelled:
        raise
    except GazelocError as error:
        artifact.remember_failure(error, before)
        raise
    return StageTime(name, stage.title, time.monotonic() - started, ran=True)


def _stages_of(
    project: Project, method: Method, only: str | None, until: str | None
) -> Iterator[tuple[Stage, str | None]]:
    yield from ((stage, None) for stage in _needed(project, {method}) if stage.of_scan)
    of_recording = [stage for stage in STAGES if not stage.of_scan and method in stage.methods]
    if until is not None:
        of_recording = of_recording[: 1 + [stage.name for stage in of_recording].index(until)]
    for name in _recordings(project, only):
        yield from ((stage, name) for stage in of_recording if stage.is_needed(project))


def _recordings(project: Project, only: str | None) -> list[str]:
    if only is not None:
        project.recording(only)
        return [only]
    return list(project.settings.recordings)
