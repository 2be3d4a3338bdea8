"""Stages of the method `sfm` that bring scan and reconstruction together: alignment and refinement.

Alignments are kept for ever, named by their content; `project.json` says which one is in force. A run puts its own
outcome in force only where no person has chosen.
"""

from __future__ import annotations

from dataclasses import asdict

from gazeloc_core.alignment.alignment import Alignment, AlignOptions, align
from gazeloc_core.alignment.correspondences import Correspondences, gather
from gazeloc_core.alignment.refine import Refinement, RefineOptions, refine
from gazeloc_core.errors import GeometryError, ProjectError
from gazeloc_core.progress import Report, silent
from gazeloc_core.project import Chosen, Project
from gazeloc_core.stages import inputs
from gazeloc_core.storage.files import read_json, write_json_atomically


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
    options = options or align_options(project)
    report(0.1, "fitting the keypoints")
    pairs = correspondences(project, recording)
    groups = len(pairs.group_names)
    if groups == 0:
        raise GeometryError(_why_no_keypoints(project, recording))
    try:
        alignment = align(pairs, options, model=inputs.load_sfm_model(project, recording))
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


def align_options(project: Project) -> AlignOptions:
    """How a project's keypoints are aligned: with the known size of its tags, and what they measure on the scan."""
    tags = project.settings.tags
    if tags is None or tags.size_m is None:
        return AlignOptions()
    artifact = project.scan_artifact("corners")
    corners = inputs.load_corners(artifact.read_arrays()) if artifact.exists else None
    return AlignOptions(
        tag_size_m=tags.size_m, scan_tag_scale=None if corners is None else corners.free_scale(tags.size_m)
    )


def alignment_inputs(project: Project, recording: str) -> dict[str, str]:
    """The hashes that an alignment depends on."""
    values = {
        "reconstruction": inputs.sfm_models(project, recording).header().content,
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
    options = options or RefineOptions(align=align_options(project))
    key = start or fitted_alignment(project, recording)
    refinement = refine(
        load_alignment(project, recording, key),
        inputs.load_sfm_model(project, recording),
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
        "reconstruction": inputs.sfm_models(project, recording).header().content,
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
