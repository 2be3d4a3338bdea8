"""Stages about a recording alone: keyframes, undistorted pictures, tags in every frame, the reconstruction."""

from __future__ import annotations

import shutil
from dataclasses import asdict, replace
from pathlib import Path

import cv2
import numpy as np

from gazeloc_core.arrays import Ints
from gazeloc_core.errors import InputError
from gazeloc_core.frames.undistort import Undistorter, UndistortOptions
from gazeloc_core.progress import Report, silent
from gazeloc_core.project import Project
from gazeloc_core.recording import Recording
from gazeloc_core.sfm.bridges import MoreFrames, spaced
from gazeloc_core.sfm.colmap_io import read_model
from gazeloc_core.sfm.colmap_join import join_to_recording
from gazeloc_core.sfm.keyframes import KeyframeOptions, choose_keyframes, measure_frames
from gazeloc_core.sfm.reconstruction import SfmOptions, reconstruct
from gazeloc_core.sfm_model import SfmModel
from gazeloc_core.stages import inputs
from gazeloc_core.stages.scan import tag_entry
from gazeloc_core.storage.files import write_json_atomically
from gazeloc_core.storage.user_files import about
from gazeloc_core.tags.corners import SfmCornerOptions, triangulate_sfm_corners
from gazeloc_core.tags.detection import TagOptions, detect_tags

JPEG_QUALITY = 95
BRIDGES_HZ = 15.0
"""Where neighbouring keyframes share little, up to this many frames per second are reconstructed."""


def find_keyframes(
    project: Project, recording: str, options: KeyframeOptions | None = None, report: Report = silent
) -> None:
    """Choose the frames to be registered, by sharpness and motion alone.

    A recording that brings its own COLMAP model has chosen already: its keyframes are the frames of that model.
    """
    options = options or KeyframeOptions()
    opened = inputs.load_recording(project, recording)
    measures = measure_frames(opened, report)
    entry = project.recording(recording)
    if entry.colmap is None:
        keyframes = choose_keyframes(opened.timestamp_ns, measures, options)
    else:
        keyframes = np.sort(own_frames_of_model(opened, entry.colmap, entry.colmap_times))
    project.artifact(recording, "keyframes").write_arrays(
        {"keyframes": keyframes, "sharpness": measures.sharpness, "motion_px": measures.motion_px},
        options=asdict(options),
        inputs=keyframe_inputs(project, recording),
        stats={"frames": len(opened), "keyframes": len(keyframes)},
    )


def own_frames_of_model(recording: Recording, colmap: Path, colmap_times: Path | None) -> Ints:
    """The frame (K,) of a recording that each image of a COLMAP model is.

    Raises:
        InputError: if the model cannot be read, is not of this camera, or its images stay ambiguous.
    """
    with about(colmap):
        return join_to_recording(read_model(colmap), recording, Undistorter.of(recording.camera).target, colmap_times)


def keyframe_inputs(project: Project, recording: str) -> dict[str, str]:
    """The hashes that the keyframes depend on."""
    entry = project.recording(recording)
    values = {"recording": inputs.recording_hash(project, recording)}
    if entry.colmap is not None:
        values["COLMAP model"] = project.hash_of_file(entry.colmap)
    if entry.colmap_times is not None:
        values["COLMAP times"] = project.hash_of_file(entry.colmap_times)
    return values


def undistort(
    project: Project, recording: str, options: UndistortOptions | None = None, report: Report = silent
) -> None:
    """Write the keyframes as a pinhole camera sees them, and that camera."""
    options = options or UndistortOptions()
    opened = inputs.load_recording(project, recording)
    keyframes = load_keyframes(project, recording)
    undistorter = Undistorter.of(opened.camera, options)

    def make(folder: Path) -> None:
        write_json_atomically(folder / "camera.json", undistorter.target.to_json())
        (folder / "images").mkdir()
        _write_pictures(opened, undistorter, keyframes, folder / "images", report)

    project.artifact(recording, "undistorted").write(
        make,
        options=asdict(options),
        inputs=undistort_inputs(project, recording),
        stats={"images": len(keyframes)},
    )


def _write_pictures(
    recording: Recording, undistorter: Undistorter, frames: Ints, folder: Path, report: Report = silent
) -> list[str]:
    """Write some frames as a pinhole camera sees them; their names, in order."""
    for done, (index, rgb) in enumerate(recording.frames.iterate(frames.tolist())):
        report(done / len(frames), f"undistorting frame {index}")
        bgr = cv2.cvtColor(undistorter.image(rgb), cv2.COLOR_RGB2BGR)
        if not cv2.imwrite(str(folder / image_name(index)), bgr, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]):
            raise InputError.of(folder, "a frame could not be written", "check the free space on the disk")
    return [image_name(index) for index in frames.tolist()]


def undistort_inputs(project: Project, recording: str) -> dict[str, str]:
    """The hashes that the undistorted pictures depend on."""
    return {"keyframes": project.artifact(recording, "keyframes").header().content}


def image_name(frame_index: int) -> str:
    """The name of a frame's undistorted picture: it ends in the frame's number, from 0."""
    return f"frame_{frame_index:06d}.jpg"


def load_keyframes(project: Project, recording: str) -> Ints:
    """The frames to be registered, rising."""
    return np.asarray(project.artifact(recording, "keyframes").read_arrays()["keyframes"], dtype=np.int64)


def detect_recording_tags(
    project: Project, recording: str, options: TagOptions | None = None, report: Report = silent
) -> None:
    """Find tags in every frame of the recording, undistorted."""
    options = options or TagOptions(family=tag_entry(project).family)
    opened = inputs.load_recording(project, recording)
    undistorter = Undistorter(opened.camera, inputs.load_undistorted_camera(project, recording))
    frames = ((index, undistorter.image(rgb)) for index, rgb in opened.frames.iterate(range(len(opened))))
    sightings = detect_tags(frames, len(opened), options, report)
    project.artifact(recording, "tags").write_arrays(
        inputs.sightings_arrays(sightings),
        options=asdict(options),
        inputs=tag_inputs(project, recording),
        stats={
            "frames": len(opened),
            "frames with a tag": len(np.unique(sightings.frame_index)),
            "tags": len(np.unique(sightings.tag_id)),
        },
    )


def tag_inputs(project: Project, recording: str) -> dict[str, str]:
    """The hashes that the tags in the recording's frames depend on."""
    return {
        "recording": inputs.recording_hash(project, recording),
        "undistorted": project.artifact(recording, "undistorted").header().content,
        "family": tag_entry(project).family,
    }


def reconstruct_keyframes(
    project: Project, recording: str, options: SfmOptions | None = None, report: Report = silent
) -> None:
    """Structure from motion on the undistorted keyframes, or the recording's own COLMAP model."""
    options = options or SfmOptions()
    artifact = project.artifact(recording, "reconstruction")
    work = artifact.folder.with_name(f".{artifact.stage}.work")
    try:
        models = _import_model(project, recording) or _reconstruct(project, recording, options, work, report)
    finally:
        shutil.rmtree(work, ignore_errors=True)

    artifact.write_arrays(
        inputs.model_arrays(models),
        options=asdict(options),
        inputs=reconstruction_inputs(project, recording),
        stats={
            "models": len(models),
            "registered": len(models[0]),
            "keyframes": len(load_keyframes(project, recording)),
            "points": len(models[0].points),
            "error_px": float(np.mean(models[0].point_errors_px)) if len(models[0].points) else None,
        },
    )


def reconstruction_inputs(project: Project, recording: str) -> dict[str, str]:
    """The hashes that the reconstruction depends on."""
    values = {"undistorted": project.artifact(recording, "undistorted").header().content}
    if project.settings.tags is not None:
        values["tags"] = project.artifact(recording, "tags").header().content
    return values | keyframe_inputs(project, recording)


def _import_model(project: Project, recording: str) -> list[SfmModel]:
    entry = project.recording(recording)
    if entry.colmap is None:
        return []
    model = read_model(entry.colmap)
    camera = inputs.load_undistorted_camera(project, recording)
    opened = inputs.load_recording(project, recording)
    return [replace(model, frame_indices=join_to_recording(model, opened, camera, entry.colmap_times))]


def _reconstruct(project: Project, recording: str, options: SfmOptions, work: Path, report: Report) -> list[SfmModel]:
    opened, keyframes = inputs.load_recording(project, recording), load_keyframes(project, recording)
    camera = inputs.load_undistorted_camera(project, recording)
    undistorter = Undistorter(opened.camera, camera)
    has_tags = project.settings.tags is not None
    return reconstruct(
        project.artifact(recording, "undistorted").folder / "images",
        [image_name(index) for index in keyframes.tolist()],
        camera,
        keyframes,
        work,
        options,
        report,
        sightings=inputs.load_sightings(project.artifact(recording, "tags").read_arrays()) if has_tags else None,
        more_frames=MoreFrames(
            spaced(opened.timestamp_ns, BRIDGES_HZ),
            lambda frames, folder: _write_pictures(opened, undistorter, frames, folder),
        ),
    )


def triangulate_tags(
    project: Project, recording: str, options: SfmCornerOptions | None = None, report: Report = silent
) -> None:
    """Triangulate the corners of every tag in the reconstruction, over all registered frames that show it."""
    options = options or SfmCornerOptions()
    sightings = project.artifact(recording, "tags")
    report(0, "triangulating tag corners")
    corners = triangulate_sfm_corners(
        inputs.load_sfm_model(project, recording),
        inputs.load_undistorted_camera(project, recording),
        inputs.load_sightings(sightings.read_arrays()),
        options,
    )
    project.artifact(recording, "corners").write_arrays(
        inputs.corners_arrays(corners),
        options=asdict(options),
        inputs=corner_inputs(project, recording),
        notes=corners.notes,
        stats={"tags": len(corners)},
    )


def corner_inputs(project: Project, recording: str) -> dict[str, str]:
    """The hashes that the tag corners in the reconstruction depend on."""
    return {
        "tags": project.artifact(recording, "tags").header().content,
        "reconstruction": inputs.sfm_models(project, recording).header().content,
    }
