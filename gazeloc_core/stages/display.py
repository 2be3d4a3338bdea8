"""Stage: the scan made fit for the screen, kept so that only the first look at a large scan waits for it.

    scan/display/scan.glb      what the viewer draws, an ordinary glTF file
    scan/display/header.json   `stats`: which side is drawn, and how many faces of how many

No method needs it, so that it is none of those in stage_list.py; the app makes it in the process that draws.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gazeloc_core.arrays import Floats
from gazeloc_core.errors import GazelocError, ProjectError
from gazeloc_core.progress import Report, silent
from gazeloc_core.project import Project
from gazeloc_core.scan import Mesh, RoomScan
from gazeloc_core.stages import inputs
from gazeloc_core.storage.artifacts import State
from gazeloc_core.surfaces.display_mesh import MAX_FACES
from gazeloc_core.surfaces.glb import Glb
from gazeloc_core.surfaces.scan_display import ScanDisplay, scan_display

_FILE = "scan.glb"


def make_display(project: Project, report: Report = silent) -> ScanDisplay:
    """Make the scan fit for the screen and keep it."""
    report(0.0, "making the scan fit for the screen")
    mesh = inputs.load_mesh(project)
    display = scan_display(mesh, scanned_from(inputs.load_scan(project), mesh))
    report(0.9, "keeping it")
    project.scan_artifact("display").write(
        lambda folder: _write(folder / _FILE, display.glb),
        options={"max_faces": MAX_FACES},
        inputs=display_inputs(project),
        stats={"front": display.front, "faces": display.faces, "faces of the scan": display.faces_of_scan},
    )
    return display


def display_inputs(project: Project) -> dict[str, str]:
    """The hashes that the display depends on."""
    colors = project.scan_artifact("colors")
    return {
        "scan": inputs.scan_hash(project),
        "colors": colors.header().content if colors.exists else "",
        "max_faces": str(MAX_FACES),
    }


def load_display(project: Project) -> ScanDisplay | None:
    """The display that was kept; None where there is none, or it is damaged or of another scan."""
    artifact = project.scan_artifact("display")
    try:
        if artifact.state(display_inputs(project))[0] is not State.FRESH:
            return None
        stats = artifact.header().stats
        glb = Glb.from_bytes((artifact.folder / _FILE).read_bytes(), str(artifact.folder / _FILE))
        return ScanDisplay(glb, int(stats["front"]), int(stats["faces"]), int(stats["faces of the scan"]))
    except (GazelocError, OSError, KeyError, TypeError, ValueError):
        return None


def scanned_from(scan: RoomScan, mesh: Mesh) -> Floats:
    """Where the scan was looked at from, (N, 3) in the frame `scan`: its frames, or the middle where it has none."""
    places = [np.asarray(frame.scan_from_camera.translation) for frame in scan.frames]
    return np.array(places or [mesh.bounds.mean(axis=0)])


def _write(path: Path, glb: Glb) -> None:
    try:
        path.write_bytes(glb.to_bytes())
    except OSError as error:
        raise ProjectError(
            f"{path.parent}: the scan's display could not be kept ({error.strerror}); free some space there."
        ) from error
