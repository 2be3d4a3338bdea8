"""Readers, one file per format. `open_scan` and `open_recording` find the right one and say why."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

from gazeloc_core.errors import InputError
from gazeloc_core.progress import Report, part, silent
from gazeloc_core.readers import arkitscenes, image_folder, mesh_file, pupil_cloud, scanner_app
from gazeloc_core.readers.depth_check import DepthAgreement, depth_agreement
from gazeloc_core.readers.gaze_check import check_gaze
from gazeloc_core.recording import Recording
from gazeloc_core.scan import RoomScan
from gazeloc_core.surfaces.scan_colors import color_from_frames

__all__ = ["DepthAgreement", "depth_agreement", "open_recording", "open_scan"]


@dataclass(frozen=True)
class ScanFormat:
    """A kind of scan: its name, what it is known by, why a path is one (None if it is not), and its reader."""

    name: str
    known_by: str
    recognise: Callable[[Path], str | None]
    read: Callable[[Path, str | None, str | None, Report], RoomScan]


@dataclass(frozen=True)
class RecordingFormat:
    """A kind of recording, as `ScanFormat`."""

    name: str
    known_by: str
    recognise: Callable[[Path], str | None]
    read: Callable[[Path], Recording]


Kind = TypeVar("Kind", ScanFormat, RecordingFormat)

SCAN_FORMATS = (
    ScanFormat(scanner_app.FORMAT, "frame_*.json", scanner_app.recognise, scanner_app.read),
    ScanFormat(arkitscenes.FORMAT, arkitscenes.TRAJECTORY, arkitscenes.recognise, arkitscenes.read),
    ScanFormat("bare mesh", "one PLY, OBJ, GLB or STL file", mesh_file.recognise, mesh_file.read),
)
RECORDING_FORMATS = (
    RecordingFormat(pupil_cloud.FORMAT, "world_timestamps.csv", pupil_cloud.recognise, pupil_cloud.read),
    RecordingFormat(
        image_folder.FORMAT,
        "images with camera.json, scene_camera.json or cameras.txt",
        image_folder.recognise,
        image_folder.read,
    ),
)


def open_scan(
    path: Path,
    *,
    unit: str | None = None,
    up_axis: str | None = None,
    colored: bool = True,
    report: Report = silent,
) -> RoomScan:
    """The scan at a path, in metres; a mesh without colours is coloured from the posed frames. `notes` says the rest.

    `unit` (m, cm, mm, ft, in) and `up_axis` (x, y, z, -x, -y, -z) are for meshes that do not say. `colored=False` saves
    the seconds that colouring takes, for those who need only the shape; vertices and faces are the same.

    Raises:
        InputError: if no format is recognised, or the files are missing, damaged or do not fit together.
    """
    path = Path(path)
    mesh_file.check_unit_and_axis(unit, up_axis)
    kind, why = _recognised(path, SCAN_FORMATS, "scan")
    scan = kind.read(path, unit, up_axis, part(report, 0.0, 0.5))
    scan = replace(scan, notes=(f"Recognised as {kind.name}: {why}.", *scan.notes))
    if not colored or scan.mesh.has_colors or not scan.frames_with_images:
        return scan
    mesh, note = color_from_frames(scan, part(report, 0.5, 1.0))
    return replace(scan, mesh=mesh, notes=(*scan.notes, note))


def open_recording(path: Path, *, report: Report = silent) -> Recording:
    """The recording at a path; `notes` says how it was recognised and what the reader found worth saying.

    Raises:
        InputError: if no format is recognised, or the files are missing, damaged or do not fit together.
    """
    path = Path(path)
    kind, why = _recognised(path, RECORDING_FORMATS, "recording")
    report(0.1, f"reading {path.name}")
    recording = kind.read(path)
    notes = (f"Recognised as {kind.name}: {why}.", *recording.notes, *check_gaze(recording))
    return replace(recording, notes=notes)


def _recognised(path: Path, kinds: tuple[Kind, ...], what: str) -> tuple[Kind, str]:
    if not path.exists():
        raise InputError.of(path, "there is no such file or folder", f"give the path of the {what}")
    try:
        for kind in kinds:
            if (why := kind.recognise(path)) is not None:
                return kind, why
        found = sorted(p.name for p in path.iterdir()) if path.is_dir() else []
    except OSError as error:
        raise InputError.of(path, f"it cannot be read ({error.strerror})", "check its permissions") from error
    looked_for = "; ".join(f"{kind.name} ({kind.known_by})" for kind in kinds)
    held = f"it holds {', '.join(found[:8])}{', ...' if len(found) > 8 else ''}" if found else "it holds no files"
    held = held if path.is_dir() else "it is a single file"
    raise InputError.of(
        path, f"no known kind of {what}: {held}; looked for {looked_for}", "name the exported folder itself"
    )
