"""Stage: every gaze sample of a recording as a ray to its hit on the scan, with one method's poses."""

from __future__ import annotations

from dataclasses import asdict

from gazeloc_core.errors import ProjectError
from gazeloc_core.gaze import GazeInScan, GazeOptions, cast_gaze
from gazeloc_core.methods import Method
from gazeloc_core.progress import Report, silent
from gazeloc_core.project import Project
from gazeloc_core.stages import inputs
from gazeloc_core.storage.artifacts import State


def cast_gaze_rays(
    project: Project,
    recording: str,
    method: Method = Method.SFM,
    options: GazeOptions | None = None,
    report: Report = silent,
) -> GazeInScan | None:
    """Cast every gaze sample into the scan; a recording without gaze gives None, and an artifact that says so."""
    options = options or GazeOptions()
    opened = inputs.load_recording(project, recording)
    trajectory = inputs.load_trajectory(project.result(recording, method, "trajectory").read_arrays())
    artifact = project.result(recording, method, "gaze")
    if opened.gaze is None:
        artifact.write_arrays(
            {},
            options=asdict(options),
            inputs=gaze_inputs(project, recording, method),
            notes=("The recording has no gaze.",),
            stats={"samples": 0},
        )
        return None
    gaze = cast_gaze(opened, trajectory, inputs.load_raycaster(project), options, report)
    artifact.write_arrays(
        inputs.gaze_arrays(gaze),
        options=asdict(options),
        inputs=gaze_inputs(project, recording, method),
        stats={"samples": len(gaze), **gaze.counts()},
    )
    return gaze


def fresh_gaze(project: Project, recording: str, method: Method = Method.SFM) -> GazeInScan | None:
    """The gaze on the scan with a method's poses; None for a recording without gaze.

    Raises:
        ProjectError: if it was not cast yet, or with earlier poses.
    """
    artifact = project.result(recording, method, "gaze")
    state, reason = artifact.state(gaze_inputs(project, recording, method))
    if state is not State.FRESH:
        raise ProjectError(f"{recording}: the gaze is {state.value} ({reason}); run `gazeloc run` first.")
    return inputs.load_gaze(artifact.read_arrays()) if artifact.header().stats["samples"] else None


def gaze_inputs(project: Project, recording: str, method: Method = Method.SFM) -> dict[str, str]:
    """The hashes that the gaze in the scan depends on."""
    return {
        "scan": inputs.scan_hash(project),
        "recording": inputs.recording_hash(project, recording),
        "trajectory": project.result(recording, method, "trajectory").header().content,
    }
