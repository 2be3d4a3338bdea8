"""`gazeloc keypoints import` and `export`: clicked keypoints from and to files, by the functions of the app."""

from __future__ import annotations

from pathlib import Path

from gazeloc_core.clicks.keypoint_cells import SideName
from gazeloc_core.clicks.keypoint_files import WRITERS, far_outside, keypoints_text, merged, read_keypoints
from gazeloc_core.errors import InputError, ProjectError
from gazeloc_core.project import Project
from gazeloc_core.stages import inputs
from gazeloc_core.storage.files import write_text_atomically
from gazeloc_core.storage.user_files import read_bytes


def import_keypoints(folder: Path, file: Path, *, recording: str | None, side: SideName) -> None:
    """Merge the keypoints of a file into the recording's, and say how many there are now."""
    project = Project.open(folder)
    name = _recording(project, recording)
    content, scan = read_bytes(file), inputs.load_scan(project)
    read = read_keypoints(str(file), content, side, scan.metres_per_unit)
    with project.lock():
        before = project.keypoints(name)
        after = merged(before, read)
        project.save_keypoints(name, after)
    counting = sum(pair.counts for pair in after)
    text = f"{name}: {len(read)} keypoints from {file}, {len(after) - len(before)} of them new; {counting} pairs count."
    print(f"{text}{far_outside(read, *scan.mesh.bounds)}")


def export_keypoints(folder: Path, file: Path, *, recording: str | None, format: str | None) -> None:
    """Write the recording's keypoints to a file, in the format named or that of the file's ending."""
    project = Project.open(folder)
    name = _recording(project, recording)
    chosen = format or {".json": "json", ".csv": "csv"}.get(file.suffix.lower(), "")
    if chosen not in WRITERS:
        raise InputError(f"--format {chosen or file.name}: choose one of {', '.join(WRITERS)}.")
    keypoints = project.keypoints(name)
    if len(keypoints) == 0:
        raise ProjectError(f"{name}: there is no keypoint to export; click some in the app (`gazeloc view`).")
    try:
        unit_m = inputs.load_scan(project).metres_per_unit
        write_text_atomically(file, keypoints_text(chosen, keypoints, unit_m))
    except OSError as error:
        raise InputError.of(file, f"it cannot be written ({error.strerror})", "name another file") from error
    print(f"{file}: {len(keypoints)} keypoints.")


def _recording(project: Project, name: str | None) -> str:
    """The recording that is meant: the one named, or the only one."""
    names = tuple(project.settings.recordings)
    if name is None and len(names) == 1:
        return names[0]
    if name is None:
        raise InputError(f"{project.folder}: there are {len(names)} recordings, name one with --recording.")
    project.recording(name)
    return name
