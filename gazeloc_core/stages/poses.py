"""Stages that give the frames of a recording their poses in the scan: one per method, one artifact each."""

from __future__ import annotations

from dataclasses import asdict

from gazeloc_core.artifacts import State
from gazeloc_core.errors import GazelocError, ProjectError
from gazeloc_core.localize.sfm import LocalizeSfmOptions, localize_sfm
from gazeloc_core.methods import Method
from gazeloc_core.progress import Report, silent
from gazeloc_core.project import Project
from gazeloc_core.stages import inputs
from gazeloc_core.stages.recording import load_keyframes
from gazeloc_core.stages.registration import chosen_alignment
from gazeloc_core.trajectory import Trajectory
from gazeloc_core.transforms import Similarity


def place_sfm(
    project: Project, recording: str, options: LocalizeSfmOptions | None = None, report: Report = silent
) -> Trajectory:
    """Put the reconstruction's camera poses into the scan by the alignment in force."""
    options = options or LocalizeSfmOptions()
    report(0.1, "placing the cameras")
    trajectory = localize_sfm(
        inputs.load_recording(project, recording).timestamp_ns,
        load_keyframes(project, recording),
        inputs.load_model(project, recording),
        chosen_alignment(project, recording).scan_from_sfm,
        options,
    )
    project.result(recording, Method.SFM, "trajectory").write_arrays(
        inputs.trajectory_arrays(trajectory),
        options=asdict(options),
        inputs=sfm_inputs(project, recording),
        stats=_counts(trajectory),
    )
    return trajectory


def sfm_inputs(project: Project, recording: str) -> dict[str, str]:
    """The hashes that the poses of the method `sfm` depend on."""
    chosen = project.settings.chosen.get(recording)
    return {
        "keyframes": project.artifact(recording, "keyframes").header().content,
        "reconstruction": project.artifact(recording, "reconstruction").header().content,
        "alignment": chosen_alignment(project, recording).key if chosen is None else chosen.alignment,
    }


def scan_from_model(project: Project, recording: str, method: Method) -> Similarity:
    """Where a method puts the reconstruction.

    Raises:
        ProjectError: if it has not aligned it yet.
    """
    del method
    return chosen_alignment(project, recording).scan_from_sfm


INPUTS = {Method.SFM: sfm_inputs}
"""The hashes that each method's poses depend on."""


def fresh_trajectory(project: Project, recording: str, method: Method = Method.SFM) -> Trajectory:
    """The poses in the scan by a method.

    Raises:
        ProjectError: if there are none, or they are of an earlier alignment or reconstruction.
    """
    artifact = project.result(recording, method, "trajectory")
    state, reason = artifact.state(INPUTS[method](project, recording))
    if state is not State.FRESH:
        raise ProjectError(
            f"{recording}: the poses of the method {method} are {state.value} ({reason}); "
            f"run `gazeloc run --method {method}` first."
        )
    return inputs.load_trajectory(artifact.read_arrays())


def methods_with_poses(project: Project, recording: str) -> list[Method]:
    """The methods that have run on a recording, whether their poses are still fresh or not."""
    return [method for method in Method if project.result(recording, method, "trajectory").exists]


def fresh_methods(project: Project, recording: str) -> list[Method]:
    """The methods whose poses can be used as they are."""
    return [method for method in methods_with_poses(project, recording) if _is_fresh(project, recording, method)]


def _is_fresh(project: Project, recording: str, method: Method) -> bool:
    try:
        expected = INPUTS[method](project, recording)
    except GazelocError:  # an earlier stage has no result any more
        return False
    return project.result(recording, method, "trajectory").state(expected)[0] is State.FRESH


def _counts(trajectory: Trajectory) -> dict[str, int]:
    return {
        "frames": len(trajectory),
        "keyframes": int(trajectory.is_keyframe.sum()),
        "registered": int(trajectory.is_registered.sum()),
        "with a pose": int(trajectory.has_pose.sum()),
    }
