"""Stages that give the frames of a recording their poses in the scan: one per method, one artifact each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict

from gazeloc_core.errors import GazelocError, ProjectError
from gazeloc_core.localize.sfm import LocalizeSfmOptions, localize_sfm
from gazeloc_core.methods import Method
from gazeloc_core.progress import Report, silent
from gazeloc_core.project import Project
from gazeloc_core.sfm_model import PlacedModel
from gazeloc_core.stages import inputs
from gazeloc_core.stages.baselines import method_alignment
from gazeloc_core.stages.pieces import placed_pieces
from gazeloc_core.stages.recording import load_keyframes
from gazeloc_core.stages.registration import chosen_alignment
from gazeloc_core.stages.tags import tags_inputs, tags_paper_inputs
from gazeloc_core.stages.tracking import load_tracked, tracked_content
from gazeloc_core.storage.artifacts import Artifact, State
from gazeloc_core.trajectory import Trajectory


def place_sfm(
    project: Project, recording: str, options: LocalizeSfmOptions | None = None, report: Report = silent
) -> Trajectory:
    """Put the reconstruction's camera poses into the scan by the alignment in force, smaller pieces by theirs."""
    pieces = project.artifact(recording, "pieces").header().notes
    return _place_models(project, recording, Method.SFM, sfm_inputs(project, recording), options, pieces, report)


def sfm_inputs(project: Project, recording: str) -> dict[str, str]:
    """The hashes that the poses of the method `sfm` depend on."""
    chosen = project.settings.chosen.get(recording)
    in_force = chosen_alignment(project, recording).key if chosen is None else chosen.alignment
    tracked = tracked_content(project, recording)
    return {
        **_model_inputs(project, recording, inputs.sfm_models(project, recording)),
        "pieces": project.artifact(recording, "pieces").header().content,
        "alignment": in_force,
        **({} if tracked is None else {"tracked frames": tracked}),
    }


def place_by_method(
    project: Project,
    recording: str,
    method: Method,
    options: LocalizeSfmOptions | None = None,
    report: Report = silent,
) -> Trajectory:
    """Put the reconstruction's camera poses into the scan by the alignment of `sfm-paper` or `global`."""
    notes = project.result(recording, method, "alignment").header().notes
    return _place_models(project, recording, method, method_inputs(project, recording, method), options, notes, report)


def method_inputs(project: Project, recording: str, method: Method) -> dict[str, str]:
    """The hashes that the poses of `sfm-paper` and `global` depend on."""
    alignment = project.result(recording, method, "alignment").header().content
    reconstruction = project.artifact(recording, "reconstruction")
    return {**_model_inputs(project, recording, reconstruction), "alignment": alignment}


def _model_inputs(project: Project, recording: str, models: Artifact) -> dict[str, str]:
    keyframes = project.artifact(recording, "keyframes")
    return {"keyframes": keyframes.header().content, "reconstruction": models.header().content}


def placed_models(project: Project, recording: str, method: Method) -> list[PlacedModel]:
    """The reconstruction, or its pieces, where a method puts them in the scan.

    Raises:
        ProjectError: if the method has not aligned it yet.
    """
    if method is not Method.SFM:
        scan_from_sfm = method_alignment(project, recording, method).scan_from_sfm
        return [PlacedModel(inputs.load_model(project, recording), scan_from_sfm)]
    in_force = chosen_alignment(project, recording)
    largest = inputs.load_sfm_model(project, recording)
    tracked = load_tracked(project, recording)
    return [PlacedModel(largest, in_force.scan_from_sfm, tracked), *placed_pieces(project, recording)]


def _place_models(
    project: Project,
    recording: str,
    method: Method,
    depends: Mapping[str, str],
    options: LocalizeSfmOptions | None,
    notes: tuple[str, ...],
    report: Report,
) -> Trajectory:
    options = options or LocalizeSfmOptions()
    report(0.1, "placing the cameras")
    trajectory = localize_sfm(
        inputs.load_recording(project, recording).timestamp_ns,
        load_keyframes(project, recording),
        placed_models(project, recording, method),
        options,
    )
    project.result(recording, method, "trajectory").write_arrays(
        inputs.trajectory_arrays(trajectory),
        options=asdict(options),
        inputs=depends,
        notes=notes,
        stats=trajectory.counts(),
    )
    return trajectory


def _inputs_of(project: Project, recording: str, method: Method) -> dict[str, str]:
    match method:
        case Method.SFM:
            return sfm_inputs(project, recording)
        case Method.TAGS:
            return tags_inputs(project, recording)
        case Method.TAGS_PAPER:
            return tags_paper_inputs(project, recording)
        case Method.SFM_PAPER | Method.GLOBAL:
            return method_inputs(project, recording, method)


def fresh_trajectory(project: Project, recording: str, method: Method = Method.SFM) -> Trajectory:
    """The poses in the scan by a method.

    Raises:
        ProjectError: if there are none, or they are of an earlier alignment or reconstruction.
    """
    artifact = project.result(recording, method, "trajectory")
    state, reason = artifact.state(_inputs_of(project, recording, method))
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
        expected = _inputs_of(project, recording, method)
    except GazelocError:  # an earlier stage has no result any more
        return False
    return project.result(recording, method, "trajectory").state(expected)[0] is State.FRESH
