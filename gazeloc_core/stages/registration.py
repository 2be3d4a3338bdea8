"""Stages that bring scan and recording together: alignment, refinement, poses in the scan, gaze in the scan.

Alignments are kept for ever, named by their content; `project.json` says which one is in force. A run puts its own
outcome in force only where no person has chosen.
"""

from __future__ import annotations

from dataclasses import asdict

from gazeloc_core.alignment import Alignment, AlignOptions, align
from gazeloc_core.artifacts import State
from gazeloc_core.correspondences import Correspondences, gather
from gazeloc_core.errors import GeometryError, ProjectError
from gazeloc_core.files import read_json, write_json_atomically
from gazeloc_core.gaze import GazeInScan, GazeOptions, cast_gaze
from gazeloc_core.localize.sfm import LocalizeSfmOptions, PlacedModel, localize_sfm
from gazeloc_core.progress import Report, silent
from gazeloc_core.project import Chosen, Project
from gazeloc_core.refine import Refinement, RefineOptions, refine
from gazeloc_core.stages import inputs
from gazeloc_core.stages.recording import load_keyframes
from gazeloc_core.trajectory import Trajectory


def save_alignment(project: Project, recording: str, alignment: Alignment) -> None:
    """Keep an alignment under the name of its content; one that is there already stays as it is."""
    path = project.alignments_folder(recording) / f"{alignment.key}.json"
    if not path.exists():
        write_json_atomically(path, alignment.to_json())


def load_alignment(project: Project, recording: str, key: str) -> Alignment:
    """An alignment by its key.

    Raises:
        ProjectError: if it is missing or was changed after it was made.
    """
    path = project.alignments_folder(recording) / f"{key}.json"
    if not path.is_file():
        raise ProjectError(f"{path}: the alignment is missing; align again.")
    return Alignment.from_json(read_json(path, "an alignment"))


def correspondences(project: Project, recording: str) -> Correspondences:
    """The pairs that an alignment is fitted to: the corners of tags that both sides know, and clicked keypoints."""
    corners = []
    for artifact in (project.scan_artifact("corners"), project.artifact(recording, "corners")):
        corners.append(inputs.load_corners(artifact.read_arrays()) if artifact.exists else None)
    return gather(corners[0], corners[1], project.keypoints(recording))


def align_keypoints(
    project: Project, recording: str, options: AlignOptions | None = None, report: Report = silent
) -> Alignment:
    """Fit the similarity to the keypoints and put it in force (see `choose`).

    Raises:
        GeometryError: if there are too few keypoints, or they do not determine an alignment.
    """
    options = options or _align_options(project)
    report(0.1, "fitting the keypoints")
    pairs = correspondences(project, recording)
    groups = len(pairs.group_names)
    if groups == 0:
        raise GeometryError(_why_no_keypoints(project, recording))
    try:
        alignment = align(pairs, options, model=inputs.load_model(project, recording))
    except GeometryError as error:
        raise GeometryError(f"{recording}: {error}") from error
    save_alignment(project, recording, alignment)
    project.artifact(recording, "alignment").write(
        lambda folder: write_json_atomically(folder / "alignment.json", {"key": alignment.key}),
        options=asdict(options),
        inputs=alignment_inputs(project, recording),
        notes=tuple(verdict.text for verdict in alignment.verdicts),
        stats={"keypoints": len(pairs), "groups": groups},
    )
    choose(project, recording, alignment.key)
    return alignment


def _why_no_keypoints(project: Project, recording: str) -> str:
    remedy = "click at least three pairs in the app (`gazeloc view`)"
    tags = project.settings.tags
    if tags is None:
        return (
            f"{recording}: there is no keypoint yet; {remedy}, or print tags and name their family with --tag-family."
        )
    found = []
    for where, artifact in (
        ("phone's", project.scan_artifact("corners")),
        ("glasses'", project.artifact(recording, "corners")),
    ):
        ids = inputs.load_corners(artifact.read_arrays()).tag_id.tolist() if artifact.exists else []
        found.append(f"the {where} frames show {', '.join(map(str, ids[:8])) or 'none'}")
    return (
        f"{recording}: no tag of the family {tags.family} is on both sides ({', '.join(found)}); {remedy}, "
        "or make the project with the right --tag-family."
    )


def _align_options(project: Project) -> AlignOptions:
    tags = project.settings.tags
    return AlignOptions(tag_size_m=tags.size_m if tags else None)


def alignment_inputs(project: Project, recording: str) -> dict[str, str]:
    """The hashes that an alignment depends on."""
    values = {
        "reconstruction": project.artifact(recording, "reconstruction").header().content,
        "keypoints": project.hash_of_keypoints(recording),
    }
    if project.settings.tags is not None:
        values["tags on the scan"] = project.scan_artifact("corners").header().content
        values["tags in the reconstruction"] = project.artifact(recording, "corners").header().content
    return values


def fitted_alignment(project: Project, recording: str) -> str:
    """The key of the alignment that the stage `alignment` made.

    Raises:
        ProjectError: if it has not run.
    """
    artifact = project.artifact(recording, "alignment")
    artifact.header()
    return str(read_json(artifact.folder / "alignment.json", "the key of an alignment")["key"])


def choose(project: Project, recording: str, key: str | None, *, by_person: bool = False) -> bool:
    """Put an alignment in force; False, and nothing changes, where a run would replace a person's choice."""
    chosen = project.settings.chosen.get(recording)
    if chosen is not None and chosen.by_person and not by_person:
        return False
    project.choose(recording, None if key is None else Chosen(alignment=key, by_person=by_person))
    return True


def refine_alignment(
    project: Project,
    recording: str,
    options: RefineOptions | None = None,
    start: str | None = None,
    report: Report = silent,
) -> Refinement:
    """Refine an alignment with ICP, point-to-point and point-to-plane, and put it in force if its evidence allows.

    `start` is the key to start from; without it the one that the stage `alignment` made.
    """
    options = options or RefineOptions(align=_align_options(project))
    key = start or fitted_alignment(project, recording)
    refinement = refine(
        load_alignment(project, recording, key),
        inputs.load_model(project, recording),
        inputs.load_raycaster(project),
        correspondences(project, recording),
        options,
        report=report,
    )
    for candidate in refinement.candidates:
        save_alignment(project, recording, candidate.alignment)
    project.artifact(recording, "refinement").write(
        lambda folder: write_json_atomically(folder / "refinement.json", refinement.to_json()),
        options=asdict(options),
        inputs=refinement_inputs(project, recording) | {"alignment": key},
        notes=(refinement.reason,),
        stats={"accepted": refinement.accepted},
    )
    if start is None:
        choose(project, recording, refinement.chosen.key)
    return refinement


def refinement_inputs(project: Project, recording: str) -> dict[str, str]:
    """The hashes that a refinement depends on."""
    return {
        "scan": inputs.scan_hash(project),
        "reconstruction": project.artifact(recording, "reconstruction").header().content,
        "alignment": fitted_alignment(project, recording),
    }


def chosen_alignment(project: Project, recording: str) -> Alignment:
    """The alignment in force.

    Raises:
        ProjectError: if there is none.
    """
    chosen = project.settings.chosen.get(recording)
    if chosen is None:
        raise ProjectError(f"{recording}: no alignment is in force; run `gazeloc run`, or align in the app.")
    return load_alignment(project, recording, chosen.alignment)


def place_trajectory(
    project: Project, recording: str, options: LocalizeSfmOptions | None = None, report: Report = silent
) -> Trajectory:
    """Put the reconstruction's camera poses into the scan by the alignment in force."""
    options = options or LocalizeSfmOptions()
    report(0.1, "placing the cameras")
    opened = inputs.load_recording(project, recording)
    trajectory = localize_sfm(
        opened.timestamp_ns,
        load_keyframes(project, recording),
        [PlacedModel(inputs.load_model(project, recording), chosen_alignment(project, recording).scan_from_sfm)],
        options,
    )
    project.artifact(recording, "trajectory").write_arrays(
        inputs.trajectory_arrays(trajectory),
        options=asdict(options),
        inputs=trajectory_inputs(project, recording),
        stats={
            "frames": len(trajectory),
            "keyframes": int(trajectory.is_keyframe.sum()),
            "registered": int(trajectory.is_registered.sum()),
            "with a pose": int(trajectory.has_pose.sum()),
        },
    )
    return trajectory


def fresh_trajectory(project: Project, recording: str) -> Trajectory:
    """The poses in the scan by the alignment in force.

    Raises:
        ProjectError: if there are none, or they are of an earlier alignment or reconstruction.
    """
    artifact = project.artifact(recording, "trajectory")
    state, reason = artifact.state(trajectory_inputs(project, recording))
    if state is not State.FRESH:
        raise ProjectError(f"{recording}: the poses are {state.value} ({reason}); run `gazeloc run` first.")
    return inputs.load_trajectory(artifact.read_arrays())


def trajectory_inputs(project: Project, recording: str) -> dict[str, str]:
    """The hashes that the poses in the scan depend on."""
    chosen = project.settings.chosen.get(recording)
    return {
        "keyframes": project.artifact(recording, "keyframes").header().content,
        "reconstruction": project.artifact(recording, "reconstruction").header().content,
        "alignment": chosen_alignment(project, recording).key if chosen is None else chosen.alignment,
    }


def cast_gaze_rays(
    project: Project, recording: str, options: GazeOptions | None = None, report: Report = silent
) -> GazeInScan | None:
    """Cast every gaze sample into the scan; a recording without gaze gives None, and an artifact that says so."""
    options = options or GazeOptions()
    opened = inputs.load_recording(project, recording)
    artifact = project.artifact(recording, "trajectory")
    trajectory = inputs.load_trajectory(artifact.read_arrays())
    if opened.gaze is None:
        project.artifact(recording, "gaze").write_arrays(
            {},
            options=asdict(options),
            inputs=gaze_inputs(project, recording),
            notes=("The recording has no gaze.",),
            stats={"samples": 0},
        )
        return None
    gaze = cast_gaze(opened, trajectory, inputs.load_raycaster(project), options, report)
    project.artifact(recording, "gaze").write_arrays(
        inputs.gaze_arrays(gaze),
        options=asdict(options),
        inputs=gaze_inputs(project, recording),
        stats={"samples": len(gaze), **gaze.counts()},
    )
    return gaze


def gaze_inputs(project: Project, recording: str) -> dict[str, str]:
    """The hashes that the gaze in the scan depends on."""
    return {
        "scan": inputs.scan_hash(project),
        "recording": inputs.recording_hash(project, recording),
        "trajectory": project.artifact(recording, "trajectory").header().content,
    }
