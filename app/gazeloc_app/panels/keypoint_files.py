"""Part of the panel of keypoints: reading them from a file, and saving them as one, on the computer of the browser."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

from viser import GuiApi

from gazeloc_app import widgets
from gazeloc_app.actions.action import Action, Notify
from gazeloc_app.actions.files import ImportKeypoints
from gazeloc_app.state import AppState, Level
from gazeloc_core.clicks.keypoint_cells import SideName
from gazeloc_core.clicks.keypoint_files import WRITERS, far_outside, keypoints_text, read_keypoints
from gazeloc_core.errors import InputError
from gazeloc_core.scan import RoomScan

SIDES: dict[str, SideName] = {"the scan": "scan", "the reconstruction": "sfm"}
FORMATS = {
    "JSON, everything": "json",
    "CSV": "csv",
    "CloudCompare, on the scan": "cloudcompare-scan",
    "CloudCompare, in the reconstruction": "cloudcompare-sfm",
    "Stray, on the scan": "stray-scan",
    "Stray, in the reconstruction": "stray-sfm",
}


class KeypointFiles:
    """Import by an upload, export by a download; nothing is written on the server."""

    def __init__(self, gui: GuiApi, state: AppState, scan: Callable[[], RoomScan], dispatch: Callable[[Action], None]):
        """`scan()` is what keypoints are clicked on; lists of other programs are in its file's unit."""
        self._state, self._scan, self._dispatch = state, scan, dispatch
        with gui.add_folder("Files", expand_by_default=False):
            self._side = gui.add_dropdown(
                "Lists are of",
                tuple(SIDES),
                hint="Lists of CloudCompare and Stray hold one side; in tables of pairs it is the reference's. "
                "Pairs of the same name get it, others are added.",
            )
            self._upload: Any = gui.add_upload_button(
                "Read keypoints",
                hint="JSON, CSV, CloudCompare's picked list or table of pairs, Stray's keypoints.json. One undo.",
            )
            self._format = gui.add_dropdown("Format", tuple(FORMATS), hint="Of the file that is saved.")
            self._save = gui.add_button("Save keypoints", color="gray", hint="Saves a file on your computer.")
        widgets.on_user(self._upload, lambda event: self._read(event.target.value), event="on_upload")
        widgets.on_user(self._save, lambda event: self._send(event.client), event="on_click")

    def render(self, state: AppState) -> None:
        """Remember what would be saved."""
        self._state = state
        widgets.set_property(self._save, "disabled", len(state.annotation.keypoints) == 0)

    def _read(self, file: Any) -> None:
        name = " ".join(str(file.name).split())[:80]
        side = SIDES.get(str(self._side.value), "scan")
        try:
            scan = self._scan()
            read = read_keypoints(name, bytes(file.content), side, scan.metres_per_unit)
            self._dispatch(ImportKeypoints(read, name, far_outside(read, *scan.mesh.bounds)))
        except InputError as error:
            self._dispatch(Notify(Level.ERROR, str(error)))

    def _send(self, client: Any) -> None:
        chosen = FORMATS.get(str(self._format.value), "json")
        text = keypoints_text(chosen, self._state.annotation.keypoints, self._scan().metres_per_unit)
        stem = re.sub(r"[^A-Za-z0-9._-]+", "-", self._state.recording)
        client.send_file_download(f"{stem}-keypoints{WRITERS[chosen][0]}", text.encode(), save_immediately=True)
