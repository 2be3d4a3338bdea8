"""The reconstruction as a COLMAP model in the scan's coordinates: metres, the scan's own axes and origin.

COLMAP's files have no place for what people said about a frame, so that is in a table beside them.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import RigidTransform

from gazeloc_core.arrays import Ints
from gazeloc_core.errors import InputError
from gazeloc_core.export.frame_notes import HEADINGS, FrameNotes
from gazeloc_core.sfm.colmap_io import write_model
from gazeloc_core.sfm_model import PlacedModel, SfmModel
from gazeloc_core.storage.export_files import move_all, staging_folder

MARKER = "gazeloc.txt"
NOTES_FILE = "frames.csv"
MARKER_TEXT = (
    "Written by GazeLoc: a COLMAP model in scan coordinates (metres). Its folder is replaced by later exports.\n"
)


def write_colmap(
    placed: Sequence[PlacedModel], folder: Path, *, notes: FrameNotes | None = None, overwrite: bool = False
) -> list[Path]:
    """Write cameras, images and points of a reconstruction's pieces, mapped into the scan, to `folder`; the files.

    An image that is in two pieces is written with its pose in the first. `notes` go into `frames.csv`, by image.

    Raises:
        InputError: if the folder holds files that GazeLoc did not write, or cannot be written.
    """
    if folder.exists() and not folder.is_dir():
        raise InputError.of(folder, "this is a file", "choose another output folder")
    is_foreign = folder.is_dir() and any(folder.iterdir()) and not (folder / MARKER).is_file()
    if is_foreign and not overwrite:
        raise InputError.of(folder, "the folder holds files that GazeLoc did not write", "choose another output folder")
    rows = [_new_images(piece.model, placed[:number]) for number, piece in enumerate(placed)]
    models = [piece.model for piece in placed]
    poses = [
        piece.scan_from_sfm.compose_pose(piece.model.sfm_from_camera[row])
        for piece, row in zip(placed, rows, strict=True)
        if len(row)
    ]
    with staging_folder(folder) as staging:
        write_model(
            staging,
            {key: camera for model in reversed(models) for key, camera in model.cameras.items()},
            tuple(model.image_names[i] for model, row in zip(models, rows, strict=True) for i in row),
            np.concatenate([model.image_camera_ids[row] for model, row in zip(models, rows, strict=True)]),
            RigidTransform.concatenate(poses),
            np.concatenate([piece.scan_from_sfm.apply(piece.model.points) for piece in placed]),
            np.concatenate([model.point_colors for model in models]),
        )
        (staging / MARKER).write_text(MARKER_TEXT, encoding="utf-8")
        if notes is not None:
            table = _notes_table(models, rows, notes)
            (staging / NOTES_FILE).write_text(table, encoding="utf-8", newline="\n")
        return move_all(staging, folder)


def _notes_table(models: Sequence[SfmModel], rows: Sequence[Ints], notes: FrameNotes) -> str:
    """A row of every image that is written, with its frame in the recording and what is known of that."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(["image name", "frame index", *HEADINGS])
    for model, row in zip(models, rows, strict=True):
        for i in row.tolist():
            frame = int(model.frame_indices[i])
            table.writerow([model.image_names[i], str(frame), *notes.cells(frame)])
    return text.getvalue()


def _new_images(model: SfmModel, before: Sequence[PlacedModel]) -> Ints:
    """The rows of the model's images that are in none of the pieces before it."""
    known = {name for piece in before for name in piece.model.image_names}
    return np.array([i for i, name in enumerate(model.image_names) if name not in known], dtype=np.int64)
