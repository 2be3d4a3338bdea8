"""Stage: the frames between a reconstruction's images, registered by its points (method `sfm`).

Poses are kept in the reconstruction's own frame: another alignment moves them along with the images. A long recording
takes minutes, so what is done is kept beside the artifact: work that was cancelled or killed goes on where it was.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from gazeloc_core.errors import GazelocError, ProjectError
from gazeloc_core.localize.tracking import TRACKED_COLUMNS, Tracking, TrackingOptions, track_stretches
from gazeloc_core.progress import Report, part, silent
from gazeloc_core.project import Project
from gazeloc_core.sfm_model import TrackedFrames
from gazeloc_core.stages import inputs
from gazeloc_core.stages.begun_tracking import BegunTracking
from gazeloc_core.storage.hashing import hash_of_value


def track_between(
    project: Project, recording: str, options: TrackingOptions | None = None, report: Report = silent
) -> list[Tracking]:
    """Track the frames between the images of every model, the largest first, from where an interrupted run stopped."""
    options = options or TrackingOptions()
    opened, models = inputs.load_recording(project, recording), inputs.load_sfm_models(project, recording)
    is_taken = np.zeros(len(opened), dtype=np.bool_)
    for model in models:
        is_taken[model.frame_indices[model.frame_indices >= 0]] = True
    artifact, depends = project.artifact(recording, "tracking"), tracking_inputs(project, recording)
    begun = BegunTracking(artifact, hash_of_value([depends, asdict(options)]))
    try:
        for rank, model in enumerate(models):
            share = part(report, rank / len(models), (rank + 1) / len(models))
            for stretch in track_stretches(model, opened, is_taken, options, share, skip=begun.stretches(rank)):
                begun.put(rank, stretch)
    finally:
        begun.save()
    results = [begun.joined(rank) for rank in range(len(models))]
    artifact.write_arrays(
        {
            f"{rank}_{name}": getattr(result.tracked, name)
            for rank, result in enumerate(results)
            for name in TRACKED_COLUMNS
        },
        options=asdict(options),
        inputs=depends,
        stats=_stats(results),
    )
    begun.forget()
    return results


def tracking_inputs(project: Project, recording: str) -> dict[str, str]:
    """The hashes that tracked frames depend on."""
    return {
        "recording": inputs.recording_hash(project, recording),
        "reconstruction": inputs.sfm_models(project, recording).header().content,
    }


def tracked_content(project: Project, recording: str) -> str | None:
    """The hash of the tracked frames that belong to the reconstruction as it is now; None where there are none."""
    artifact = project.artifact(recording, "tracking")
    if not project.settings.track_frames or not artifact.exists:
        return None
    try:
        header = artifact.header()
        current = inputs.sfm_models(project, recording).header().content
    except GazelocError:  # damaged, or of a reconstruction that is gone: as if they were not there
        return None
    return header.content if header.inputs.get("reconstruction") == current else None


def load_tracked(project: Project, recording: str, rank: int = 0) -> TrackedFrames | None:
    """The tracked frames of the largest model (`rank` 0) or a smaller one; None where there are none of it as it is.

    Raises:
        ProjectError: if they are damaged.
    """
    if tracked_content(project, recording) is None:
        return None
    artifact = project.artifact(recording, "tracking")
    arrays: dict[str, Any] = artifact.read_arrays()
    if f"{rank}_frame_indices" not in arrays:
        return None
    try:
        return TrackedFrames(**{name: arrays[f"{rank}_{name}"] for name in TRACKED_COLUMNS})
    except (KeyError, ValueError) as error:
        raise ProjectError(
            f"{artifact.folder}: the tracked frames are damaged ({error}); remove it and run again."
        ) from error


def _stats(results: list[Tracking]) -> dict[str, int]:
    stats = {
        "tried": sum(result.tried for result in results),
        "tracked": sum(len(result.tracked) for result in results),
    }
    for result in results:
        for reason, count in result.refused.items():
            stats[reason.value] = stats.get(reason.value, 0) + count
    return stats
