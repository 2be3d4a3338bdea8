"""What a project's results are worth: errors against a ground truth, and the evidence of the alignment in words."""

from __future__ import annotations

from pathlib import Path

from gazeloc_core.errors import GazelocError, InputError
from gazeloc_core.evaluation.evaluate import Evaluation, evaluate
from gazeloc_core.evaluation.truth import read_tum
from gazeloc_core.methods import Method
from gazeloc_core.project import Project
from gazeloc_core.stages.poses import fresh_methods, fresh_trajectory
from gazeloc_core.stages.registration import chosen_alignment
from gazeloc_core.storage.user_files import about


def evaluate_recording(
    project: Project,
    recording: str,
    truth: Path | None = None,
    method: Method = Method.SFM,
    *,
    without_bad: bool = False,
) -> Evaluation:
    """The errors of a recording's trajectory against a truth file; by default the one that the project names.

    `without_bad` leaves out the frames that people marked bad.

    Raises:
        InputError: if there is no truth file, or its times are not the recording's.
        ProjectError: if there is no trajectory yet, or it is of an earlier alignment.
    """
    path = truth or project.recording(recording).truth
    if path is None:
        raise InputError(f"{recording}: the project names no ground truth; give one with --truth FILE.tum.")
    timestamp_ns, poses = read_tum(path)
    trajectory = fresh_trajectory(project, recording, method)
    with about(path):
        return evaluate(trajectory, timestamp_ns, poses, project.marks(recording), without_bad=without_bad)


def evaluate_project(
    project: Project, *, truth: Path | None = None, recording: str | None = None, without_bad: bool = False
) -> dict[str, dict[Method, Evaluation]]:
    """The errors of each recording and method that has fresh poses; of those that have a truth, or of the one named.

    Raises:
        InputError: if no recording has a truth, or one truth is given for several recordings.
        ProjectError: if a recording has no fresh poses by any method.
    """
    names = [recording] if recording is not None else list(project.settings.recordings)
    if truth is not None and len(names) > 1:
        raise InputError(f"{truth}: the project has {len(names)} recordings; say which one with --recording NAME.")
    if truth is None and recording is None:
        names = [name for name in names if project.recording(name).truth is not None]
    if not names:
        raise InputError(f"{project.folder}: no recording has a ground truth; give one with --truth FILE.tum.")
    return {
        name: {
            method: evaluate_recording(project, name, truth, method, without_bad=without_bad)
            for method in _evaluated(project, name)
        }
        for name in names
    }


def _evaluated(project: Project, recording: str) -> list[Method]:
    """The methods whose poses are fresh; the recording's own method where none is, whose error then says why."""
    return fresh_methods(project, recording) or [project.method(recording)]


def verdicts(project: Project, recording: str, method: Method = Method.SFM) -> list[tuple[str, str]]:
    """What the evidence of a method's result means: (good | warning | bad, sentence). Empty without a result."""
    if method is not Method.SFM:
        artifact = project.result(recording, method, "trajectory")
        return [("warning", note) for note in artifact.header().notes] if artifact.exists else []
    try:
        alignment = chosen_alignment(project, recording)
    except GazelocError:
        return []
    refinement = project.artifact(recording, "refinement")
    notes = [("refinement", note) for note in refinement.header().notes] if refinement.exists else []
    pieces = project.artifact(recording, "pieces")
    notes += [("pieces", note) for note in pieces.header().notes] if pieces.exists else []
    return [(verdict.level, verdict.text) for verdict in alignment.verdicts] + notes
