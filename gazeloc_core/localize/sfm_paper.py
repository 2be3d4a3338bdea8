"""Method `sfm-paper`: the reconstruction aligned as in the paper's figure 10, the faithful baseline beside `sfm`.

Tag centres of both sides (`alignment/paper_keypoints.py`) give scale, rotation and place by Umeyama's closed form, over
all common tags, whoever is wrong among them; the points are scaled by that, and point-to-point ICP against points
sampled on the scan's mesh has the last word. The paper takes ICP's answer always. So does this; what it did to the
alignment is in the evidence on both.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from gazeloc_core.alignment.alignment import Alignment, AlignmentMethod, AlignOptions, align, judge
from gazeloc_core.alignment.correspondences import Correspondences
from gazeloc_core.alignment.paper_keypoints import TagCenters, center_pairs
from gazeloc_core.alignment.similarity_fit import RobustOptions
from gazeloc_core.errors import GeometryError, InputError
from gazeloc_core.progress import Report, silent
from gazeloc_core.scan import Mesh
from gazeloc_core.sfm_model import SfmModel
from gazeloc_core.surfaces.clouds import icp_point_to_point, sample_surface


@dataclass(frozen=True, kw_only=True)
class AlignPaperOptions:
    """How the paper's alignment is made. The paper gives no number."""

    icp_distance_m: float = 0.05
    """Points of the reconstruction further from the scan than this take no part in ICP, in metres."""
    icp_iterations: int = 100
    """Most iterations of ICP."""
    samples: int = 100_000
    """Points that are sampled on the scan's mesh for ICP."""
    seed: int = 0
    """Chooses these points."""
    align: AlignOptions = field(default_factory=AlignOptions)
    """How both alignments are judged; wrong tags are named there, but never left out."""

    def __post_init__(self) -> None:
        if min(self.icp_distance_m, self.icp_iterations, self.samples) <= 0 or self.seed < 0:
            raise InputError(f"The options of method sfm-paper must be above 0 (the seed may be 0), got {self}.")


@dataclass(frozen=True, eq=False)
class PaperAlignment:
    """The alignment by tag centres (`start`) and after ICP (`refined`, the method's answer), with their evidence at
    `pairs`; the share of the reconstruction's points that ICP could use, and their RMS distance from the scan."""

    start: Alignment
    refined: Alignment
    pairs: Correspondences
    icp_fitness: float
    icp_rms_m: float


def align_paper(
    scan_centers: TagCenters,
    sfm_centers: TagCenters,
    model: SfmModel,
    scan_surface: Mesh,
    options: AlignPaperOptions | None = None,
    *,
    report: Report = silent,
) -> PaperAlignment:
    """`scan_from_sfm` by the tags' centres, then by ICP of all of the model's points (sections VI-B to VI-D).

    Raises:
        GeometryError: if fewer than three tags have a centre on both sides, they lie on one line, or no point of the
            reconstruction is near the scan.
    """
    options = options or AlignPaperOptions()
    report(0.0, "fitting the tags' centres")
    pairs = center_pairs(scan_centers, sfm_centers)
    everything = replace(options.align, robust=RobustOptions(inlier_sigmas=math.inf))  # no pair is ever an outlier
    start = align(pairs, everything, model=model)
    report(0.3, f"ICP with {len(model.points)} points")
    found = icp_point_to_point(
        model.points,
        sample_surface(scan_surface, options.samples, options.seed),
        start.scan_from_sfm,
        within=options.icp_distance_m,
        iterations=options.icp_iterations,
    )
    if found is None:
        raise GeometryError(
            f"None of the reconstruction's {len(model.points)} points is within {options.icp_distance_m} m of the scan "
            "after aligning the tags' centres; check that tags with the same id are the same tag on both sides."
        )
    refined = judge(
        found.a_from_b,
        pairs,
        options.align,
        method=AlignmentMethod.ICP_POINT_TO_POINT,
        parent=start.key,
        model=model,
    )
    report(1.0, f"{100 * found.fitness:.0f} % of the points lie on the scan")
    return PaperAlignment(start, refined, pairs, found.fitness, found.rms)
