"""Aligned poses and gaze for other programs: one folder per recording and format."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from gazeloc_core.arrays import Bytes
from gazeloc_core.artifacts import State
from gazeloc_core.errors import InputError, ProjectError
from gazeloc_core.export.colmap import write_colmap
from gazeloc_core.export.gaze3d_csv import write_gaze3d_csv
from gazeloc_core.export.nerfstudio import registered_frames, write_nerfstudio
from gazeloc_core.export.poses_csv import write_poses_csv
from gazeloc_core.export.tum import write_tum
from gazeloc_core.progress import Report, part, silent
from gazeloc_core.project import Project
from gazeloc_core.stages import inputs
from gazeloc_core.stages.registration import chosen_alignment, fresh_trajectory, gaze_inputs
from gazeloc_core.undistort import Undistorter


def export(
    project: Project, *, format: str, output: Path, recording: str | None = None, report: Report = silent
) -> list[Path]:
    """Write the poses of one or all recordings; several recordings get a folder each. The files written.

    Raises:
        InputError: if the format is unknown, or the place cannot be written to or holds another program's files.
        ProjectError: if a recording has no poses yet.
    """
    if format not in FORMATS:
        raise InputError(f"--format {format}: no such format; choose one of {', '.join(FORMATS)}.")
    names = [recording] if recording is not None else list(project.settings.recordings)
    if not names:
        raise InputError(f"{project.folder}: the project has no recording; add one with `gazeloc add`.")
    files: list[Path] = []
    for position, name in enumerate(names):
        project.recording(name)
        folder = output if len(names) == 1 else output / name
        share = part(report, position / len(names), (position + 1) / len(names))
        files += FORMATS[format](project, name, folder, share)
    report(1.0, "exported")
    return files


def _csv(project: Project, recording: str, folder: Path, report: Report) -> list[Path]:
    report(0.1, "writing poses.csv")
    trajectory = fresh_trajectory(project, recording)
    gaze = project.artifact(recording, "gaze")
    state, reason = gaze.state(gaze_inputs(project, recording))
    if state is not State.FRESH:
        raise ProjectError(f"{recording}: the gaze is {state.value} ({reason}); run `gazeloc run` first.")
    files = write_poses_csv(trajectory, folder / "poses.csv")
    if gaze.header().stats["samples"]:
        report(0.5, "writing gaze3d.csv")
        files += write_gaze3d_csv(inputs.load_gaze(gaze.read_arrays()), folder / "gaze3d.csv")
    return files


def _tum(project: Project, recording: str, folder: Path, report: Report) -> list[Path]:
    report(0.1, "writing poses.tum")
    return write_tum(fresh_trajectory(project, recording), folder / "poses.tum")


def _colmap(project: Project, recording: str, folder: Path, report: Report) -> list[Path]:
    report(0.1, "writing the COLMAP model")
    scan_from_sfm = chosen_alignment(project, recording).scan_from_sfm
    return write_colmap(inputs.load_model(project, recording), scan_from_sfm, folder)


def _nerfstudio(project: Project, recording: str, folder: Path, report: Report) -> list[Path]:
    trajectory = fresh_trajectory(project, recording)
    opened = inputs.load_recording(project, recording)
    undistorter = Undistorter(opened.camera, inputs.load_undistorted_camera(project, recording))
    wanted = registered_frames(trajectory)

    def pictures() -> Iterator[tuple[int, Bytes]]:
        for index, rgb in opened.frames.iterate(np.array(wanted, dtype=np.int64).tolist()):
            yield index, undistorter.image(rgb)

    return write_nerfstudio(trajectory, undistorter.target, folder, undistorted=pictures(), report=report)


FORMATS: dict[str, Callable[[Project, str, Path, Report], list[Path]]] = {
    "csv": _csv,
    "tum": _tum,
    "colmap": _colmap,
    "nerfstudio": _nerfstudio,
}
