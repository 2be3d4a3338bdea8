"""Panel: writing the aligned poses for other programs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from viser import GuiApi

from gazeloc_app import widgets
from gazeloc_app.actions.action import Action, Notify
from gazeloc_app.actions.jobs import StartJob
from gazeloc_app.data import ProjectData
from gazeloc_app.door.paths import folder_inside
from gazeloc_app.panels.meanwhile import meanwhile
from gazeloc_app.state import AppState, Level
from gazeloc_app.work import tasks
from gazeloc_core.errors import InputError

FORMATS = {
    "csv": ("CSV", "poses.csv with a row per frame, gaze3d.csv with a row per gaze sample"),
    "tum": ("TUM", "poses.tum, for evo and its kin"),
    "colmap": ("COLMAP", "the reconstruction as a COLMAP model in scan coordinates"),
    "nerfstudio": ("nerfstudio", "transforms.json with the undistorted frames"),
}
NO_POSES = "“Run everything” in the tab Project makes them, or an alignment does."


class ExportPanel:
    """Formats, a folder, and the button. What a browser names is a folder inside of `root` and nowhere else."""

    def __init__(self, gui: GuiApi, root: Path, data: ProjectData, dispatch: Callable[[Action], None]):
        self._recording = ""
        self._has_poses = False
        self._data = data
        self._dispatch = dispatch
        self._first = gui.add_html("", visible=False)
        self._boxes = {
            name: gui.add_checkbox(label, name == "csv", hint=hint) for name, (label, hint) in FORMATS.items()
        }
        self._root = root
        self._folder = gui.add_text("Folder", "", hint="A name, of a folder that is made in the one below.")
        self._button = gui.add_button("Export", hint="Writes on the computer that runs GazeLoc.")
        gui.add_html(widgets.box(f"Into {widgets.text(root)}."))
        gui.add_html(widgets.box("Exported frames show people. Treat them like the recordings themselves."))
        widgets.on_user(self._button, lambda _: self._export(), event="on_click")

    def render(self, state: AppState) -> None:
        """Remember what would be exported."""
        self._recording = state.recording
        self._has_poses = self._data.poses_key(state.recording, state.annotation) is not None
        widgets.set_property(self._first, "visible", not self._has_poses)
        how = meanwhile(state, tasks.run_all, tasks.align) or NO_POSES
        widgets.set_content(self._first, widgets.box(widgets.card("No poses to export yet.", how)))
        widgets.set_property(self._button, "disabled", state.has_job("Export"))

    def _export(self) -> None:
        formats = tuple(name for name, box in self._boxes.items() if box.value)
        name = str(self._folder.value)
        if not self._has_poses:
            self._dispatch(Notify(Level.WARNING, "There are no poses to export yet; align, or run the method first."))
        elif not formats:
            self._dispatch(Notify(Level.WARNING, "Choose at least one format."))
        else:
            self._start(formats, name)

    def _start(self, formats: tuple[str, ...], name: str) -> None:
        try:
            output = str(folder_inside(self._root, name))
        except InputError as error:
            self._dispatch(Notify(Level.WARNING, str(error)))
            return
        keywords = (("recording", self._recording), ("formats", formats), ("output", output))
        self._dispatch(StartJob("Export", tasks.export, keywords))
