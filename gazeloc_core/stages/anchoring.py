"""Stage: the reconstruction bent to the tags on the scan, where tags left out in turn prove that it is better so."""

from __future__ import annotations

from dataclasses import asdict

from gazeloc_core.bending.anchoring import Anchoring, AnchoringOptions, bend_to_tags
from gazeloc_core.progress import Report, silent
from gazeloc_core.project import Project
from gazeloc_core.stages import inputs
from gazeloc_core.tags.corners import triangulate_sfm_corners


def anchor_reconstruction(
    project: Project, recording: str, options: AnchoringOptions | None = None, report: Report = silent
) -> Anchoring:
    """Bend the largest model to the tags, or keep it as it came; smaller ones are kept as they came.

    The artifact's note says what was decided, and why.
    """
    options = options or AnchoringOptions()
    models = inputs.load_models(project, recording)
    sightings = inputs.load_sightings(project.artifact(recording, "tags").read_arrays())
    camera = inputs.load_undistorted_camera(project, recording)
    on_scan = inputs.load_corners(project.scan_artifact("corners").read_arrays())
    in_sfm = triangulate_sfm_corners(models[0], camera, sightings)
    anchoring = bend_to_tags(models[0], sightings, on_scan, in_sfm, options, report)
    project.artifact(recording, "anchoring").write_arrays(
        inputs.model_arrays([anchoring.model, *models[1:]]),
        options=asdict(options),
        inputs=anchoring_inputs(project, recording),
        notes=(anchoring.reason,),
        stats={
            "bent": anchoring.is_accepted,
            "left_out_before_m": anchoring.left_out_before_m,
            "left_out_after_m": anchoring.left_out_after_m,
        },
    )
    return anchoring


def anchoring_inputs(project: Project, recording: str) -> dict[str, str]:
    """The hashes that the bent reconstruction depends on."""
    return {
        "reconstruction": project.artifact(recording, "reconstruction").header().content,
        "tags": project.artifact(recording, "tags").header().content,
        "tags on the scan": project.scan_artifact("corners").header().content,
    }
