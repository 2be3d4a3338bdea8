"""Aligned poses and gaze for other programs: one folder per recording and format."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path

import numpy as np

from gazeloc_core.arrays import Bytes
from gazeloc_core.errors import InputError
from gazeloc_core.export.colmap import write_colmap
from gazeloc_core.export.frame_notes import FrameNotes
from gazeloc_core.export.gaze3d_csv import write_gaze3d_csv
from gazeloc_core.export.nerfstudio import registered_frames, write_nerfstudio
from gazeloc_core.export.poses_csv import write_poses_csv
from gazeloc_core.export.tum import write_tum
from gazeloc_core.frames.undistort import Undistorter
from gazeloc_core.methods import Method
from gazeloc_core.progress import Report, part, silent
from gazeloc_core.project import Project
from gazeloc_core.stages import inputs
from gazeloc_core.stages.gaze import fresh_gaze
from gazeloc_core.stages.poses import fresh_trajectory, placed_models
from gazeloc_core.stages.scores import fresh_scores


def export(
    project: Project,
    *,
    format: str,
    output: Path,
    recording: str | None = None,
    method: Method | None = None,
    report: Report = silent,
) -> list[Path]:
    """Write the poses of one or all recordings; several recordings get a folder each. The files written.

    Without `method` each recording is exported with the one that it is shown with.

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
        files += FORMATS[format](project, name, method or project.method(name), folder, share)
    report(1.0, "exported")
    return files


def _csv(project: Project, recording: str, method: Method, folder: Path, report: Report) -> list[Path]:
    report(0.1, "writing poses.csv")
    trajectory = fresh_trajectory(project, recording, method)
    gaze = fresh_gaze(project, recording, method)
    files = write_poses_csv(trajectory, folder / "poses.csv", notes=_notes(project, recording, method))
    if gaze is not None:
        report(0.5, "writing gaze3d.csv")
        files += write_gaze3d_csv(gaze, folder / "gaze3d.csv")
    return files


def _tum(project: Project, recording: str, method: Method, folder: Path, report: Report) -> list[Path]:
    report(0.1, "writing poses.tum")
    trajectory, notes = fresh_trajectory(project, recording, method), _notes(project, recording, method)
    return write_tum(trajectory, folder / "poses.tum", notes=notes)


def _colmap(project: Project, recording: str, method: Method, folder: Path, report: Report) -> list[Path]:
    report(0.1, "writing the COLMAP model")
    if not method.has_model:
        raise InputError(
            f"--format colmap: the method {method} makes no reconstruction of {recording}; choose csv, tum or "
            "nerfstudio, or a method that does."
        )
    fresh_trajectory(project, recording, method)
    return write_colmap(placed_models(project, recording, method), folder, notes=_notes(project, recording, method))


def _nerfstudio(project: Project, recording: str, method: Method, folder: Path, report: Report) -> list[Path]:
    trajectory = fresh_trajectory(project, recording, method)
    opened = inputs.load_recording(project, recording)
    undistorter = Undistorter(opened.camera, inputs.load_undistorted_camera(project, recording))
    wanted = registered_frames(trajectory)

    def pictures() -> Iterator[tuple[int, Bytes]]:
        for index, rgb in opened.frames.iterate(np.array(wanted, dtype=np.int64).tolist()):
            yield index, undistorter.image(rgb)

    notes = _notes(project, recording, method)
    return write_nerfstudio(trajectory, undistorter.target, folder, undistorted=pictures(), notes=notes, report=report)


def _notes(project: Project, recording: str, method: Method) -> FrameNotes:
    """People's marks, and the scores of these very poses where there are any."""
    scores = fresh_scores(project, recording, method)
    columns = {} if scores is None else {"agreement": scores.score, **asdict(scores)}
    return FrameNotes(project.marks(recording), columns)


FORMATS: dict[str, Callable[[Project, str, Method, Path, Report], list[Path]]] = {
    "csv": _csv,
    "tum": _tum,
    "colmap": _colmap,
    "nerfstudio": _nerfstudio,
}
