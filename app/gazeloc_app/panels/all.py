"""All panels: which tab each is in, and what it is made from. A new panel is one line here."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeVar

import viser

from gazeloc_app.actions.action import Action
from gazeloc_app.browser import Browser
from gazeloc_app.data import ProjectData
from gazeloc_app.keypoints.suggestions import Proposals
from gazeloc_app.panels.alignment import AlignmentPanel
from gazeloc_app.panels.camera_colors import CameraColors
from gazeloc_app.panels.contents import layers_with_contents
from gazeloc_app.panels.export import ExportPanel
from gazeloc_app.panels.figures import FigurePanel
from gazeloc_app.panels.first_steps import FirstSteps
from gazeloc_app.panels.frames import FramePanel
from gazeloc_app.panels.help import HelpPanel
from gazeloc_app.panels.history import HistoryPanel
from gazeloc_app.panels.jobs import JobBar, JobLogs
from gazeloc_app.panels.keypoint_files import KeypointFiles
from gazeloc_app.panels.keypoints import KeypointPanel
from gazeloc_app.panels.layers import LayerPanel
from gazeloc_app.panels.loupe import LoupePanel
from gazeloc_app.panels.methods import MethodPanel
from gazeloc_app.panels.no_recording import NoRecording
from gazeloc_app.panels.problems import ProblemPanel
from gazeloc_app.panels.project import ProjectPanel
from gazeloc_app.panels.suggestion import SuggestionPanel
from gazeloc_app.panels.views import ViewList
from gazeloc_app.scene.sizes import size_factor
from gazeloc_app.scene.suggestion import SuggestionLayer
from gazeloc_app.scene_view import SceneView
from gazeloc_app.state import AppState, Layer
from gazeloc_core.keypoints import Point
from gazeloc_core.project import Project
from gazeloc_core.resources import static_file
from gazeloc_core.surfaces.saved_views import SavedView, usual_views
from gazeloc_core.surfaces.viewpoint import room_corners, up_vector

MAIN_WIDTH_PX, SIDE_WIDTH_PX = 400, 430


class Panel(Protocol):
    """Widgets that show the state."""

    def render(self, state: AppState) -> None:
        """Show the state."""
        ...


P = TypeVar("P")


@dataclass(frozen=True)
class Desk:
    """What panels may be made from; `state` is the one that the app begins with."""

    server: viser.ViserServer
    project: Project
    data: ProjectData
    scene: SceneView
    state: AppState
    dispatch: Callable[[Action], None]
    browser: Callable[[int], Browser | None]
    """The page of a client, None once it has gone."""
    open_recording: Callable[[str], None]
    toggle_look: Callable[[int], None]
    export_folder: Path

    @property
    def gui(self) -> viser.GuiApi:
        """The widgets that all pages share."""
        return self.server.gui

    def look_through(self, client_id: int, frame: int) -> None:
        """Let one page look through a frame."""
        browser = self.browser(client_id)
        if browser is not None:
            browser.look(frame)

    def go_to(self, client_id: int, in_scan: Point) -> None:
        """Let one page stand before a place of the scan."""
        browser = self.browser(client_id)
        if browser is not None:
            browser.go_to(in_scan)

    def contents(self, state: AppState) -> tuple[Layer, ...]:
        """The layers that have something to show."""
        return layers_with_contents(self.data, state)

    def usual_views(self) -> dict[str, SavedView]:
        """The views that every scan has."""
        return usual_views(self.data.scan().mesh, self.data.scan().up_axis)


class Tab(NamedTuple):
    """A tab and what is in it, from top to bottom."""

    title: str
    parts: tuple[Callable[[Desk], Panel], ...]


MAIN_TABS = (
    Tab(
        "Project",
        (
            lambda desk: FirstSteps(desk.gui, desk.data),
            lambda desk: ProjectPanel(desk.gui, desk.project, desk.state, desk.dispatch, desk.open_recording),
            lambda desk: JobLogs(desk.gui, str(desk.project.folder / "logs")),
        ),
    ),
    Tab(
        "Keypoints",
        (
            lambda desk: KeypointPanel(desk.gui, desk.state, desk.data, desk.dispatch),
            lambda desk: SuggestionPanel(
                desk.gui,
                Proposals(desk.data),
                desk.dispatch,
                desk.go_to,
                SuggestionLayer(desk.server.scene, lambda: size_factor(*room_corners(desk.data.mesh()))).show,
            ),
            lambda desk: KeypointFiles(desk.gui, desk.state, desk.data.scan, desk.dispatch),
        ),
    ),
    Tab("Align", (lambda desk: AlignmentPanel(desk.gui, desk.data, desk.dispatch),)),
    Tab("History", (lambda desk: HistoryPanel(desk.gui, desk.dispatch),)),
    Tab("Methods", (lambda desk: MethodPanel(desk.gui, desk.data, desk.dispatch),)),
    Tab("Figures", (lambda desk: FigurePanel(desk.gui, desk.data, desk.dispatch),)),
    Tab(
        "Layers",
        (
            lambda desk: ViewList(desk.server, desk.usual_views, up_vector(desk.data.scan().up_axis), desk.dispatch),
            lambda desk: LayerPanel(desk.gui, desk.dispatch, desk.scene.facts, desk.contents),
            lambda desk: CameraColors(desk.gui, desk.scene.cameras, desk.dispatch),
        ),
    ),
    Tab("Export", (lambda desk: ExportPanel(desk.gui, desk.export_folder, desk.data, desk.dispatch),)),
)
MAIN_TABS_WITHOUT_RECORDING = (
    Tab(
        "Project",
        (
            lambda desk: NoRecording(desk.gui, desk.project.folder),
            lambda desk: JobLogs(desk.gui, str(desk.project.folder / "logs")),
        ),
    ),
    Tab(
        "Layers",
        (
            lambda desk: ViewList(desk.server, desk.usual_views, up_vector(desk.data.scan().up_axis), desk.dispatch),
            lambda desk: LayerPanel(desk.gui, desk.dispatch, desk.scene.facts, desk.contents),
        ),
    ),
    Tab("History", (lambda desk: HistoryPanel(desk.gui, desk.dispatch),)),
)
SIDE_TABS = (
    Tab(
        "Frame",
        (
            lambda desk: FramePanel(
                desk.gui, static_file("comparison.html"), desk.data, desk.dispatch, desk.look_through
            ),
        ),
    ),
    Tab("Problems", (lambda desk: ProblemPanel(desk.gui, desk.data, desk.dispatch),)),
    Tab("Help", (lambda desk: HelpPanel(desk.gui, desk.toggle_look),)),
)
SIDE_TABS_WITHOUT_RECORDING = SIDE_TABS[-1:]


_LAST = 1e9
"""viser counts widgets from the start of the process; tabs come after whatever has such a number."""


class Panels:
    """All panels of one app: the main one on the right, jobs and loupe above its tabs, the other on the left."""

    def __init__(self, desk: Desk):
        gui = desk.gui
        gui.main_panel.dock_right()
        gui.main_panel.set_width(MAIN_WIDTH_PX)
        self._parts: list[Panel] = [JobBar(gui, desk.dispatch), LoupePanel(gui, desk.data)]
        is_usual = bool(desk.state.recordings)
        self._add(gui.add_tab_group(order=_LAST), MAIN_TABS if is_usual else MAIN_TABS_WITHOUT_RECORDING, desk)
        side = gui.add_panel()
        self._add(side, SIDE_TABS if is_usual else SIDE_TABS_WITHOUT_RECORDING, desk)
        side.dock_left()
        side.set_width(SIDE_WIDTH_PX)
        self.handles: Sequence[Any] = (gui.main_panel, side)
        """viser's own panels."""

    def __iter__(self) -> Iterator[Panel]:
        """From top to bottom, tab by tab."""
        return iter(self._parts)

    def of(self, kind: type[P]) -> P:
        """The one panel of a class."""
        return next(part for part in self._parts if isinstance(part, kind))

    def _add(self, group: Any, tabs: Sequence[Tab], desk: Desk) -> None:
        for tab in tabs:
            with group.add_tab(tab.title):
                self._parts += [make(desk) for make in tab.parts]
