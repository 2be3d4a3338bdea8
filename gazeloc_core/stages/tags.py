"""Stages of the methods that localise by tags alone: `tags` and `tags-paper`."""

from __future__ import annotations

from dataclasses import asdict

from gazeloc_core.localize.tag_localization import TagLocalization
from gazeloc_core.localize.tags import LocalizeTagsOptions, localize_tags
from gazeloc_core.localize.tags_paper import TagsPaperOptions, localize_tags_paper
from gazeloc_core.methods import Method
from gazeloc_core.progress import Report, silent
from gazeloc_core.project import Project
from gazeloc_core.stages import inputs
from gazeloc_core.stages.recording import load_keyframes
from gazeloc_core.stages.scan import tag_entry


def place_tags(
    project: Project, recording: str, options: LocalizeTagsOptions | None = None, report: Report = silent
) -> TagLocalization:
    """Localise every frame that shows a tag of the scan, all sightings joined."""
    options = options or LocalizeTagsOptions()
    found = localize_tags(
        inputs.load_recording(project, recording).timestamp_ns,
        load_keyframes(project, recording),
        inputs.load_undistorted_camera(project, recording),
        inputs.load_sightings(project.artifact(recording, "tags").read_arrays()),
        inputs.load_corners(project.scan_artifact("corners").read_arrays()),
        options,
        raycaster=inputs.load_raycaster(project),
        report=report,
    )
    _write(project, recording, Method.TAGS, found, asdict(options), tags_inputs(project, recording))
    return found


def tags_inputs(project: Project, recording: str) -> dict[str, str]:
    """The hashes that the poses of the method `tags` depend on."""
    return {
        **_recording_inputs(project, recording),
        "scan": inputs.scan_hash(project),
        "tags on the scan": project.scan_artifact("corners").header().content,
    }


def place_tags_paper(
    project: Project, recording: str, options: TagsPaperOptions | None = None, report: Report = silent
) -> TagLocalization:
    """Localise every frame that shows a tag of the phone's frames, the two tag poses chained as in the paper."""
    options = options or TagsPaperOptions()
    found = localize_tags_paper(
        inputs.load_recording(project, recording).timestamp_ns,
        load_keyframes(project, recording),
        inputs.load_undistorted_camera(project, recording),
        inputs.load_sightings(project.artifact(recording, "tags").read_arrays()),
        inputs.load_scan(project),
        inputs.load_sightings(project.scan_artifact("tags").read_arrays()),
        tag_entry(project).size_m,
        options,
        report=report,
    )
    _write(project, recording, Method.TAGS_PAPER, found, asdict(options), tags_paper_inputs(project, recording))
    return found


def tags_paper_inputs(project: Project, recording: str) -> dict[str, str]:
    """The hashes that the poses of the method `tags-paper` depend on."""
    return {
        **_recording_inputs(project, recording),
        "tags in the phone's frames": project.scan_artifact("tags").header().content,
        "tag size": str(tag_entry(project).size_m),
    }


def _recording_inputs(project: Project, recording: str) -> dict[str, str]:
    return {stage: project.artifact(recording, stage).header().content for stage in ("keyframes", "tags")}


def _write(
    project: Project,
    recording: str,
    method: Method,
    found: TagLocalization,
    options: dict[str, object],
    depends: dict[str, str],
) -> None:
    columns = ("tags_used", "rms_px", "disagreement_m", "is_ambiguous")
    project.result(recording, method, "trajectory").write_arrays(
        inputs.trajectory_arrays(found.trajectory) | {name: getattr(found, name) for name in columns},
        options=options,
        inputs=depends,
        notes=found.notes,
        stats={
            **found.trajectory.counts(),
            "ambiguous": int(found.is_ambiguous.sum()),
        },
    )
