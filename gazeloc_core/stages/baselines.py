"""Stages of the methods that the paper gives or compares with: how `sfm-paper` and `global` place a reconstruction."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from gazeloc_core.alignment.alignment import Alignment, AlignmentMethod, judge
from gazeloc_core.alignment.paper_keypoints import scan_tag_centers, sfm_tag_centers
from gazeloc_core.localize.global_ import GlobalOptions, GlobalRegistration, align_global
from gazeloc_core.localize.sfm_paper import AlignPaperOptions, PaperAlignment, align_paper
from gazeloc_core.methods import Method
from gazeloc_core.progress import Report, part, silent
from gazeloc_core.project import Project
from gazeloc_core.stages import inputs
from gazeloc_core.stages.registration import align_options, correspondences
from gazeloc_core.storage.files import read_json, write_json_atomically
from gazeloc_core.surfaces.meshing import delaunay_surface, poisson_surface

_FILE = "alignment.json"


@dataclass(frozen=True, kw_only=True)
class GlobalStageOptions:
    """How the reconstruction is aligned by shape alone."""

    surface: Literal["poisson", "delaunay"] = "poisson"
    """How the sparse points become a surface."""
    registration: GlobalOptions = field(default_factory=GlobalOptions)
    """How both surfaces are registered."""


def align_sfm_paper(
    project: Project, recording: str, options: AlignPaperOptions | None = None, report: Report = silent
) -> PaperAlignment:
    """Align the reconstruction by the tags' centres and point-to-point ICP, as in the paper's figure 10."""
    options = options or AlignPaperOptions(align=align_options(project))
    model = inputs.load_model(project, recording)
    report(0.0, "tag centres by the paper's recipe")
    on_scan = scan_tag_centers(
        inputs.load_scan(project),
        inputs.load_raycaster(project),
        inputs.load_sightings(project.scan_artifact("tags").read_arrays()),
    )
    in_sfm = sfm_tag_centers(
        model,
        inputs.load_undistorted_camera(project, recording),
        inputs.load_sightings(project.artifact(recording, "tags").read_arrays()),
    )
    found = align_paper(
        on_scan, in_sfm.centers, model, inputs.load_raycaster(project).mesh, options, report=part(report, 0.2, 1)
    )
    _write(
        project,
        recording,
        Method.SFM_PAPER,
        {"start": found.start.to_json(), "alignment": found.refined.to_json()},
        {"point_tag": in_sfm.point_tag, "point": in_sfm.point, "is_kept": in_sfm.is_kept},
        options=asdict(options),
        inputs=sfm_paper_inputs(project, recording),
        notes=(*on_scan.notes, *in_sfm.centers.notes),
        stats={"tags": len(found.pairs), "icp_fitness": found.icp_fitness, "icp_rms_m": found.icp_rms_m},
    )
    return found


def sfm_paper_inputs(project: Project, recording: str) -> dict[str, str]:
    """The hashes that the paper's alignment depends on."""
    return {
        "scan": inputs.scan_hash(project),
        "reconstruction": project.artifact(recording, "reconstruction").header().content,
        "tags": project.artifact(recording, "tags").header().content,
        "tags in the phone's frames": project.scan_artifact("tags").header().content,
    }


def align_globally(
    project: Project, recording: str, options: GlobalStageOptions | None = None, report: Report = silent
) -> GlobalRegistration:
    """Align a surface of the reconstruction with the scan by shape alone; judged at tags and keypoints where known."""
    options = options or GlobalStageOptions()
    model = inputs.load_model(project, recording)
    report(0.0, f"{options.surface} surface of the reconstruction")
    make = poisson_surface if options.surface == "poisson" else delaunay_surface
    found = align_global(
        make(model), inputs.load_raycaster(project).mesh, options.registration, report=part(report, 0.3, 1)
    )
    alignment = judge(
        found.scan_from_sfm,
        correspondences(project, recording),
        align_options(project),
        method=AlignmentMethod.SHAPE,
        model=model,
    )
    steps = {step.name: [step.fitness, step.rms_m if np.isfinite(step.rms_m) else None] for step in found.steps}
    _write(
        project,
        recording,
        Method.GLOBAL,
        {"alignment": alignment.to_json()},
        {},
        options=asdict(options),
        inputs=global_inputs(project, recording),
        notes=tuple(verdict.text for verdict in alignment.verdicts),
        stats={"steps": steps},
    )
    return found


def global_inputs(project: Project, recording: str) -> dict[str, str]:
    """The hashes that the alignment by shape depends on; not the keypoints, which only judge it."""
    return {
        "scan": inputs.scan_hash(project),
        "reconstruction": project.artifact(recording, "reconstruction").header().content,
    }


def method_alignment(project: Project, recording: str, method: Method) -> Alignment:
    """Where `sfm-paper` or `global` puts the reconstruction, with the evidence on it.

    Raises:
        ProjectError: if the method has not run, or its file is damaged.
    """
    artifact = project.result(recording, method, "alignment")
    artifact.header()
    return Alignment.from_json(read_json(artifact.folder / _FILE, "an alignment")["alignment"])


def _write(
    project: Project,
    recording: str,
    method: Method,
    value: Mapping[str, Any],
    arrays: Mapping[str, NDArray[Any]],
    **header: Any,
) -> None:
    def make(folder: Path) -> None:
        write_json_atomically(folder / _FILE, value)
        columns: dict[str, Any] = dict(arrays)
        np.savez_compressed(folder / "arrays.npz", **columns)

    project.result(recording, method, "alignment").write(make, **header)
