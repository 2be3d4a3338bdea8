"""The smaller pieces of a reconstruction that broke: each is aligned to the scan by its own tags, or said not to be.

A piece has an origin, axes and a scale of its own, so nothing of the largest piece's alignment holds for it. What it
needs is what the largest one needed: tags that its own frames show, triangulated in it and known on the scan, and
evidence that nothing speaks against.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from gazeloc_core.alignment.alignment import Alignment, AlignOptions, align
from gazeloc_core.alignment.correspondences import gather
from gazeloc_core.camera import Camera
from gazeloc_core.errors import GeometryError
from gazeloc_core.keypoints import KeypointSet
from gazeloc_core.sfm_model import SfmModel
from gazeloc_core.tag_types import TagCorners, TagSightings
from gazeloc_core.tags.corners import SfmCornerOptions, triangulate_sfm_corners


@dataclass(frozen=True, kw_only=True)
class PieceOptions:
    """How the smaller pieces are aligned."""

    corners: SfmCornerOptions = field(default_factory=SfmCornerOptions)
    """How tags are triangulated in a piece."""
    align: AlignOptions = field(default_factory=AlignOptions)
    """How a piece is aligned, and where its evidence is bad."""


@dataclass(frozen=True)
class Piece:
    """The model of this `rank` (0 is the largest), its alignment or None, and the sentence that says why."""

    rank: int
    alignment: Alignment | None
    reason: str

    @property
    def is_placed(self) -> bool:
        """Whether the frames of the piece have a place in the scan."""
        return self.alignment is not None


def place_pieces(
    models: Sequence[SfmModel],
    camera: Camera,
    sightings: TagSightings | None,
    scan_corners: TagCorners | None,
    options: PieceOptions | None = None,
) -> tuple[Piece, ...]:
    """The pieces beside the largest: `models` as `reconstruct` returns them, of which the first is left to `align`.

    `camera` is the undistorted camera, `sightings` are the recording's tags in undistorted frames, `scan_corners` the
    tags in the frame `scan`; None where there are no tags. A piece is placed only where no verdict on it is bad.
    """
    options = options or PieceOptions()
    return tuple(
        _placed(rank, model, camera, sightings, scan_corners, options) for rank, model in enumerate(models[1:], start=1)
    )


def _placed(
    rank: int,
    model: SfmModel,
    camera: Camera,
    sightings: TagSightings | None,
    scan_corners: TagCorners | None,
    options: PieceOptions,
) -> Piece:
    what = f"Piece {rank + 1} of the reconstruction ({len(model)} frames)"
    if sightings is None or scan_corners is None:
        return Piece(rank, None, f"{what} cannot be placed without tags; its frames have no pose.")
    own = triangulate_sfm_corners(model, camera, sightings, options.corners)
    shared = sorted(set(own.tag_id.tolist()) & set(scan_corners.tag_id.tolist()))
    if not shared:
        return Piece(rank, None, f"{what} determines no tag that is on the scan; its frames have no pose.")
    named = ("tag " if len(shared) == 1 else "tags ") + ", ".join(map(str, shared))
    try:
        alignment = align(gather(scan_corners, own, KeypointSet()), options.align, model=model)
    except GeometryError as error:
        return Piece(rank, None, f"{what} shows {named}, but cannot be aligned: {error}")
    bad = [verdict.text for verdict in alignment.verdicts if verdict.level == "bad"]
    if bad:
        return Piece(rank, None, f"{what} shows {named}, but its alignment is not to be trusted: {bad[0]}")
    return Piece(rank, alignment, f"{what} is aligned by its own {named}.")
