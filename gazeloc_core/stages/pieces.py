"""Stage: the smaller pieces of a reconstruction that broke, each aligned by its own tags or said not to be."""

from __future__ import annotations

from dataclasses import asdict

from gazeloc_core.alignment.alignment import Alignment
from gazeloc_core.bending.pieces import Piece, PieceOptions, place_pieces
from gazeloc_core.errors import ProjectError
from gazeloc_core.progress import Report, silent
from gazeloc_core.project import Project
from gazeloc_core.sfm_model import PlacedModel
from gazeloc_core.stages import inputs
from gazeloc_core.stages.registration import align_options
from gazeloc_core.stages.tracking import load_tracked
from gazeloc_core.storage.files import read_json, write_json_atomically

_FILE = "pieces.json"


def align_pieces(
    project: Project, recording: str, options: PieceOptions | None = None, report: Report = silent
) -> tuple[Piece, ...]:
    """Align each piece beside the largest by its own evidence."""
    tags = project.settings.tags
    options = options or PieceOptions(align=align_options(project))
    report(0.1, "placing the smaller pieces")
    sightings = corners = None
    if tags is not None:
        sightings = inputs.load_sightings(project.artifact(recording, "tags").read_arrays())
        corners = inputs.load_corners(project.scan_artifact("corners").read_arrays())
    models = inputs.load_sfm_models(project, recording)
    camera = inputs.load_undistorted_camera(project, recording)
    pieces = place_pieces(models, camera, sightings, corners, options)
    rows = [
        {"rank": piece.rank, "alignment": piece.alignment and piece.alignment.to_json(), "reason": piece.reason}
        for piece in pieces
    ]
    project.artifact(recording, "pieces").write(
        lambda folder: write_json_atomically(folder / _FILE, rows),
        options=asdict(options),
        inputs=piece_inputs(project, recording),
        notes=tuple(piece.reason for piece in pieces),
        stats={"pieces": len(pieces), "placed": sum(piece.is_placed for piece in pieces)},
    )
    return pieces


def piece_inputs(project: Project, recording: str) -> dict[str, str]:
    """The hashes that the pieces' alignments depend on."""
    values = {"reconstruction": inputs.sfm_models(project, recording).header().content}
    if project.settings.tags is not None:
        values["tags"] = project.artifact(recording, "tags").header().content
        values["tags on the scan"] = project.scan_artifact("corners").header().content
    return values


def load_pieces(project: Project, recording: str) -> tuple[Piece, ...]:
    """The pieces of the stage.

    Raises:
        ProjectError: if it has not run, or its file is damaged.
    """
    artifact = project.artifact(recording, "pieces")
    artifact.header()
    try:
        return tuple(
            Piece(
                int(row["rank"]),
                None if row["alignment"] is None else Alignment.from_json(row["alignment"]),
                str(row["reason"]),
            )
            for row in read_json(artifact.folder / _FILE, "the pieces of a reconstruction")
        )
    except (KeyError, TypeError, ValueError) as error:
        raise ProjectError(f"{artifact.folder}: the pieces are damaged ({error}); remove it and run again.") from error


def placed_pieces(project: Project, recording: str) -> list[PlacedModel]:
    """The smaller pieces that have a place in the scan, largest first."""
    return [
        PlacedModel(
            inputs.load_sfm_model(project, recording, piece.rank),
            piece.alignment.scan_from_sfm,
            load_tracked(project, recording, piece.rank),
        )
        for piece in load_pieces(project, recording)
        if piece.alignment is not None
    ]
