"""Panel: writing the aligned poses for other programs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from viser import GuiApi

from gazeloc_app import tasks, widgets
from gazeloc_app.actions.action import Action, Notify
from gazeloc_app.actions.jobs import StartJob
from gazeloc_app.data import ProjectData
from gazeloc_app.state import AppState, Level

FORMATS = {
    "csv": ("CSV", "poses.csv with a row per frame, gaze3d.csv with a row per gaze sample"),
    "tum": ("TUM", "poses.tum, for evo and its kin"),
    "colmap": ("COLMAP", "the reconstruction as a COLMAP model in scan coordinates"),
    "nerfstudio": ("nerfstudio", "transforms.json with the undistorted frames"),
}


class ExportPanel:
    """Formats, a folder on the computer that runs GazeLoc, and the button."""

    def __init__(self, gui: GuiApi, folder: Path, data: ProjectData, dispatch: Callable[[Action], None]):
        self._recording = ""
        self._has_poses = False
        self._data = data
        self._dispatch = dispatch
        self._boxes = {
            name: gui.add_checkbox(label, name == "csv", hint=hint) for name, (label, hint) in FORMATS.items()
        }
        self._folder = gui.add_text("Folder", str(folder), hint="On the computer that runs GazeLoc.")
        self._button = gui.add_button("Export", icon=None)
        gui.add_html(widgets.box("Exported frames show people. Treat them like the recordings themselves."))
        widgets.on_user(self._button, lambda _: self._export(), event="on_click")

    def render(self, state: AppState) -> None:
        """Remember what would be exported."""
        self._recording = state.recording
        self._has_poses = self._data.poses_key(state.recording, state.annotation) is not None
        widgets.set_property(self._button, "disabled", state.job is not None)

    def _export(self) -> None:
        formats = tuple(name for name, box in self._boxes.items() if box.value)
        output = str(self._folder.value).strip()
        if not self._has_poses:
            self._dispatch(Notify(Level.WARNING, "There are no poses to export yet; align, or run the method first."))
        elif not formats or not output:
            self._dispatch(Notify(Level.WARNING, "Choose at least one format, and a folder."))
        else:
            keywords = (("recording", self._recording), ("formats", formats), ("output", output))
            self._dispatch(StartJob("Export", tasks.export, keywords))
