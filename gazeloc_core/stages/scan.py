"""Stages about the scan: colours where the file has none, tags in the phone's frames, tag corners on the mesh."""

from __future__ import annotations

from dataclasses import asdict

from gazeloc_core.errors import InputError, ProjectError
from gazeloc_core.progress import Report, silent
from gazeloc_core.project import Project, TagEntry
from gazeloc_core.scan import RoomScan
from gazeloc_core.stages import inputs
from gazeloc_core.surfaces.scan_colors import color_from_frames
from gazeloc_core.tags.corners import ScanCornerOptions, map_scan_corners
from gazeloc_core.tags.detection import TagOptions, detect_tags


def tag_entry(project: Project) -> TagEntry:
    """The project's tags.

    Raises:
        ProjectError: if the project has none.
    """
    tags = project.settings.tags
    if tags is None:
        raise ProjectError(
            f"{project.folder}: the project names no tag family; make it with --tag-family, or click keypoints."
        )
    return tags


def color_scan(project: Project, report: Report = silent) -> None:
    """Colour a mesh that has no colours from the phone's posed frames."""
    scan = inputs.load_scan(project)
    mesh, note = color_from_frames(scan, report)
    project.scan_artifact("colors").write_arrays(
        inputs.mesh_arrays(mesh), options={}, inputs=color_inputs(project), notes=(note,)
    )


def color_inputs(project: Project) -> dict[str, str]:
    """The hashes that the colours depend on."""
    return {"scan": inputs.scan_hash(project)}


def detect_scan_tags(project: Project, options: TagOptions | None = None, report: Report = silent) -> None:
    """Find tags in all of the phone's frames that have a picture."""
    options = options or TagOptions(family=tag_entry(project).family)
    scan = inputs.load_scan(project)
    check_tags_can_be_mapped(scan)
    frames = scan.frames_with_images
    sightings = detect_tags(((i, frame.read_image()) for i, frame in enumerate(frames)), len(frames), options, report)
    project.scan_artifact("tags").write_arrays(
        inputs.sightings_arrays(sightings),
        options=asdict(options),
        inputs=tag_inputs(project),
        stats={"frames": len(frames), "sightings": len(sightings), "tags": len(set(sightings.tag_id.tolist()))},
    )


def check_tags_can_be_mapped(scan: RoomScan) -> None:
    """Refuse a scan that shows no tags: tags are put on the mesh from posed frames.

    Raises:
        InputError: if no frame of the scan has a picture.
    """
    if not scan.frames_with_images:
        raise InputError.of(
            scan.path,
            f"the {scan.format} has no frames with pictures, so no tag can be found on it",
            "leave --tag-family out and click keypoints, or give the scan with its frames",
        )


def tag_inputs(project: Project) -> dict[str, str]:
    """The hashes that the tags in the phone's frames depend on."""
    return {"scan": inputs.scan_hash(project), "family": tag_entry(project).family}


def map_tags(project: Project, options: ScanCornerOptions | None = None, report: Report = silent) -> None:
    """Put the corners of every tag on the scan, from all posed sightings."""
    options = options or ScanCornerOptions()
    artifact = project.scan_artifact("tags")
    tags = tag_entry(project)
    corners = map_scan_corners(
        inputs.load_scan(project),
        inputs.load_raycaster(project),
        inputs.load_sightings(artifact.read_arrays()),
        options,
        tag_size_m=tags.size_m,
        report=report,
    )
    project.scan_artifact("corners").write_arrays(
        inputs.corners_arrays(corners),
        options=asdict(options),
        inputs=corner_inputs(project),
        notes=corners.notes,
        stats={"tags": len(corners)},
    )


def corner_inputs(project: Project) -> dict[str, str]:
    """The hashes that the tag corners on the scan depend on."""
    return {
        "tags": project.scan_artifact("tags").header().content,
        "tag size": str(tag_entry(project).size_m),
    }
