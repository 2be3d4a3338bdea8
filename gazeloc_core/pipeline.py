"""The method as a list of stages, and running what is missing or stale. The command line, the app and tests call this.

scan       colors ─ tags ─ corners ───────────────────────────┐
recording  keyframes ─ undistorted ┬ tags ─────────┬ corners ─┴ alignment ─ refinement ─ trajectory ─ gaze
                                   └ reconstruction ┘
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from gazeloc_core.artifacts import Artifact, State
from gazeloc_core.errors import Cancelled, GazelocError, InputError
from gazeloc_core.progress import Report, part, silent
from gazeloc_core.project import Project
from gazeloc_core.stages import inputs, recording, registration, scan
from gazeloc_core.stages.evaluation import evaluate_project, evaluate_recording, verdicts
from gazeloc_core.stages.exports import FORMATS, export

__all__ = [
    "FORMATS",
    "STAGES",
    "evaluate_project",
    "evaluate_recording",
    "export",
    "run",
    "run_stage",
    "stage_named",
    "statuses",
    "verdicts",
]

METHODS = ("sfm",)

Run = Callable[[Project, str, Report], object]
Inputs = Callable[[Project, str], Mapping[str, str]]


@dataclass(frozen=True, kw_only=True)
class Stage:
    """One stage: how it runs, what it depends on, and its usual share of the time."""

    name: str
    title: str
    run: Run
    inputs: Inputs
    of_scan: bool = False
    weight: float = 1.0
    is_needed: Callable[[Project], bool] = lambda _: True

    def artifact(self, project: Project, name: str) -> Artifact:
        """The place of its result."""
        return project.scan_artifact(self.name) if self.of_scan else project.artifact(name, self.name)


@dataclass(frozen=True)
class StageStatus:
    """How one stage of a project stands. `recording` is None for stages of the scan."""

    recording: str | None
    stage: str
    title: str
    state: State
    reason: str


def _has_tags(project: Project) -> bool:
    return project.settings.tags is not None


def _needs_colors(project: Project) -> bool:
    return not inputs.load_scan(project).mesh.has_colors and bool(inputs.load_scan(project).frames_with_images)


STAGES: tuple[Stage, ...] = (
    Stage(
        name="colors",
        title="Colour the scan",
        of_scan=True,
        weight=4,
        run=lambda project, _, report: scan.color_scan(project, report),
        inputs=lambda project, _: scan.color_inputs(project),
        is_needed=_needs_colors,
    ),
    Stage(
        name="tags",
        title="Find tags in the phone's frames",
        of_scan=True,
        weight=4,
        run=lambda project, _, report: scan.detect_scan_tags(project, report=report),
        inputs=lambda project, _: scan.tag_inputs(project),
        is_needed=_has_tags,
    ),
    Stage(
        name="corners",
        title="Put tags on the scan",
        of_scan=True,
        run=lambda project, _, report: scan.map_tags(project, report=report),
        inputs=lambda project, _: scan.corner_inputs(project),
        is_needed=_has_tags,
    ),
    Stage(
        name="keyframes",
        title="Choose keyframes",
        weight=10,
        run=lambda project, name, report: recording.find_keyframes(project, name, report=report),
        inputs=recording.keyframe_inputs,
    ),
    Stage(
        name="undistorted",
        title="Undistort keyframes",
        weight=4,
        run=lambda project, name, report: recording.undistort(project, name, report=report),
        inputs=recording.undistort_inputs,
    ),
    Stage(
        name="tags",
        title="Find tags in the glasses' frames",
        weight=30,
        run=lambda project, name, report: recording.detect_recording_tags(project, name, report=report),
        inputs=recording.tag_inputs,
        is_needed=_has_tags,
    ),
    Stage(
        name="reconstruction",
        title="Reconstruct the keyframes",
        weight=100,
        run=lambda project, name, report: recording.reconstruct_keyframes(project, name, report=report),
        inputs=recording.reconstruction_inputs,
    ),
    Stage(
        name="corners",
        title="Triangulate tags",
        run=lambda project, name, report: recording.triangulate_tags(project, name, report=report),
        inputs=recording.corner_inputs,
        is_needed=_has_tags,
    ),
    Stage(
        name="alignment",
        title="Align to the scan",
        weight=2,
        run=lambda project, name, report: registration.align_keypoints(project, name, report=report),
        inputs=registration.alignment_inputs,
    ),
    Stage(
        name="refinement",
        title="Refine with ICP",
        weight=10,
        run=lambda project, name, report: registration.refine_alignment(project, name, report=report),
        inputs=registration.refinement_inputs,
    ),
    Stage(
        name="trajectory",
        title="Put the poses into the scan",
        run=lambda project, name, report: registration.place_trajectory(project, name, report=report),
        inputs=registration.trajectory_inputs,
    ),
    Stage(
        name="gaze",
        title="Cast gaze into the scan",
        weight=2,
        run=lambda project, name, report: registration.cast_gaze_rays(project, name, report=report),
        inputs=registration.gaze_inputs,
    ),
)


def statuses(project: Project, only: str | None = None) -> list[StageStatus]:
    """How every stage of the scan and of each recording (or one) stands. Opens no video and runs nothing.

    A stage whose inputs are missing is missing itself; one whose inputs are stale is stale.
    """
    found = [_status(project, stage, None) for stage in STAGES if stage.of_scan and stage.is_needed(project)]
    for name in _recordings(project, only):
        found += [_status(project, stage, name) for stage in STAGES if not stage.of_scan and stage.is_needed(project)]
    return found


def _status(project: Project, stage: Stage, name: str | None) -> StageStatus:
    artifact = stage.artifact(project, name or "")
    try:
        state, reason = artifact.state(stage.inputs(project, name or ""))
    except InputError as error:
        state, reason = (State.STALE if artifact.exists else State.MISSING), str(error)
    except GazelocError:  # an earlier stage has no result yet
        state, reason = (State.STALE if artifact.exists else State.MISSING), "waits for an earlier stage"
    return StageStatus(name, stage.name, stage.title, state, reason)


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
    method: str = "sfm",
    recording: str | None = None,
    until: str | None = None,
    report: Report = silent,
) -> list[StageTime]:
    """Run every stage that is missing or stale, for all recordings or one, up to the stage `until`.

    Puts the outcome in force (`registration.choose`) unless a person chose an alignment. The caller holds the lock.

    Raises:
        GazelocError: what a stage raised; its sentence is kept in the project, what was there before stays.
    """
    if method not in METHODS:
        raise InputError(f"There is no method {method!r}; the methods are: {', '.join(METHODS)}.")
    todo = list(_stages_of(project, recording, until))
    total = sum(stage.weight for stage, _ in todo)
    done, times = 0.0, []
    for stage, name in todo:
        share = part(report, done / total, (done + stage.weight) / total)
        times.append(run_stage(project, stage, name, share))
        done += stage.weight
    report(1.0, "done")
    return times


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


def stage_named(name: str, *, of_scan: bool = False) -> Stage:
    """One stage of the list."""
    return next(stage for stage in STAGES if stage.name == name and stage.of_scan is of_scan)


def _stages_of(project: Project, only: str | None, until: str | None) -> Iterator[tuple[Stage, str | None]]:
    for stage in STAGES:
        if stage.of_scan and stage.is_needed(project):
            yield stage, None
    of_recording = [stage for stage in STAGES if not stage.of_scan]
    if until is not None:
        of_recording = of_recording[: 1 + [stage.name for stage in of_recording].index(until)]
    for name in _recordings(project, only):
        yield from ((stage, name) for stage in of_recording if stage.is_needed(project))


def _recordings(project: Project, only: str | None) -> list[str]:
    if only is not None:
        project.recording(only)
        return [only]
    return list(project.settings.recordings)
