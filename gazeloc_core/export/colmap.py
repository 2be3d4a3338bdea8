"""The reconstruction as a COLMAP model in the scan's coordinates: metres, the scan's own axes and origin."""

from __future__ import annotations

from pathlib import Path

from gazeloc_core.colmap_io import write_model
from gazeloc_core.errors import InputError
from gazeloc_core.export.files import move_all, staging_folder
from gazeloc_core.sfm_model import SfmModel
from gazeloc_core.transforms import Similarity

MARKER = "gazeloc.txt"
MARKER_TEXT = (
    "Written by GazeLoc: a COLMAP model in scan coordinates (metres). Its folder is replaced by later exports.\n"
)


def write_colmap(model: SfmModel, scan_from_sfm: Similarity, folder: Path, *, overwrite: bool = False) -> list[Path]:
    """Write cameras, images and points of `model`, mapped into the scan, to `folder`; the list of files written.

    Raises:
        InputError: if the folder holds files that GazeLoc did not write, or cannot be written.
    """
    if folder.exists() and not folder.is_dir():
        raise InputError.of(folder, "this is a file", "choose another output folder")
    is_foreign = folder.is_dir() and any(folder.iterdir()) and not (folder / MARKER).is_file()
    if is_foreign and not overwrite:
        raise InputError.of(folder, "the folder holds files that GazeLoc did not write", "choose another output folder")
    with staging_folder(folder) as staging:
        write_model(
            staging,
            model.cameras,
            model.image_names,
            model.image_camera_ids,
            scan_from_sfm.compose_pose(model.sfm_from_camera),
            scan_from_sfm.apply(model.points),
            model.point_colors,
        )
        (staging / MARKER).write_text(MARKER_TEXT, encoding="utf-8")
        return move_all(staging, folder)
