"""What belongs to one browser: its tool, its clicks, and the camera it looks through (people/visitors.py: reloads)."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import viser

from gazeloc_app import widgets
from gazeloc_app.actions.action import Action, Notify
from gazeloc_app.data import ProjectData
from gazeloc_app.drawing.facing import place_to_stand
from gazeloc_app.drawing.render_process import RenderProcess
from gazeloc_app.frames.looking import Looking
from gazeloc_app.keypoints.hand import Hand, Reach
from gazeloc_app.keypoints.picking import ClickFilter
from gazeloc_app.panels.looking import LookingControls
from gazeloc_app.panels.nudging import add_nudges
from gazeloc_app.scene.cut import Cut
from gazeloc_app.scene.kept import Kept
from gazeloc_app.scene_view import SceneView
from gazeloc_app.state import AppState, Level
from gazeloc_app.tools.all import kinds_for, shifted, tools_of
from gazeloc_app.tools.cloud_point import CloudPointTool
from gazeloc_app.tools.tool import Bench, Click, Tool
from gazeloc_core.errors import GazelocError
from gazeloc_core.keypoints import Point
from gazeloc_core.surfaces.viewpoint import room_corners

SHIFT = "shift"
_IN_PAGE = {True: '<div id="gazeloc-tool" data-aims hidden></div>', False: '<div id="gazeloc-tool" hidden></div>'}
"""Tells the page's lens whether the tool in hand aims."""


class Browser:
    """One connected page."""

    def __init__(
        self,
        client: viser.ClientHandle,
        data: ProjectData,
        view: SceneView,
        render: RenderProcess,
        state: Callable[[], AppState],
        dispatch: Callable[[Action], None],
    ):
        self._client, self._data, self._state, self._dispatch = client, data, state, dispatch
        self._filter = ClickFilter()
        self.looking = Looking(client, data, render, state, dispatch)
        self._add_widgets()
        self._controls = LookingControls(client, data, self.looking, state, dispatch)
        self._cut = cut = Cut(client, *room_corners(data.scan().mesh), data.scan().up_axis)
        moves = lambda: bool(self._move.value)  # noqa: E731
        snaps = lambda: bool(self._snap.value)  # noqa: E731
        bench = Bench(client, data, self.looking, state, dispatch, lambda: view.front, moves, cut, snaps)
        self._tools = tools_of(bench)
        self._in_hand = self.tool
        in_cloud = lambda: isinstance(self.tool, CloudPointTool)  # noqa: E731
        self.hand = Hand(Reach(client, data, self.looking, state, dispatch, bench.front, in_cloud, moves, snaps))
        add_nudges(client.gui, self.hand.nudge)
        for modifier in (None, SHIFT):
            client.scene.on_click(modifier=modifier)(self._handler(modifier))  # type: ignore[arg-type]

    @property
    def tool(self) -> Tool:
        """The tool in hand; a value that the page made up counts as the first."""
        return self._tools.get(str(self._choice.value)) or next(iter(self._tools.values()))

    @property
    def kept(self) -> Kept:
        """What this browser's cuts leave of the room."""
        return self._cut.kept

    def click(self, click: Click, *, is_shifted: bool = False) -> None:
        """Act on a click."""
        if not self._filter.is_new(time.monotonic(), click.direction):
            return  # the second half of a double click
        self.hand.look_elsewhere()
        tool = shifted(self.tool, self._tools) if is_shifted else self.tool
        try:
            action = tool.click(click)
        except GazelocError as error:
            action = Notify(Level.ERROR, str(error))
        self._controls.render(self._state())
        if action is not None:
            self._dispatch(action)

    def look(self, frame: int) -> None:
        """Look through a frame of the recording."""
        self.looking.look(frame)
        self._controls.render(self._state())

    def leave(self) -> None:
        """Look at the room from outside again."""
        self._controls.leave()

    def go_to(self, in_scan: Point) -> None:
        """Stand before a place of the scan and look at it."""
        self._controls.leave()
        eye = place_to_stand(self._data, self._state(), in_scan)
        with self._client.atomic():
            self._client.camera.position = eye
            self._client.camera.look_at = np.array(in_scan)

    def take_again(self, tool: str) -> None:
        """Take the tool that this browser had in hand before a reload, where there is one of that name."""
        if tool in self._tools:
            self._choice.value = tool
            self._take()

    def look_again(self, recording: str | None, frame: int) -> None:
        """Look through the frame that this browser looked through before a reload, where there still is one."""
        self.looking.look_again(recording, frame)
        self._controls.render(self._state())

    def render(self, state: AppState) -> None:
        """Follow the frame slider while looking through a camera of the recording; show the keypoints in it."""
        self.looking.follow(state)
        self._controls.render(state)
        is_selected = state.selected_key is not None and state.annotation.keypoints.get(state.selected_key) is not None
        widgets.set_property(self._move, "visible", is_selected)

    def _add_widgets(self) -> None:
        gui = self._client.gui
        kinds = kinds_for(self._state())
        hints = " ".join(f"“{kind.name}”: {kind.hint}" for kind in kinds)
        self._choice: Any = gui.add_dropdown(
            "A click",
            tuple(kind.name for kind in kinds),
            hint=f"In this browser only; the key P goes on. Dragging always orbits. {hints}",
        )
        sets_points = bool(self._state().recordings)
        self._move = gui.add_checkbox(
            "Move point", False, visible=False, hint="The next click moves the selected pair's point."
        )
        self._snap = gui.add_checkbox(
            "Snap to tags", True, visible=sets_points, hint="A click near a tag's centre or corner means that."
        )
        self._in_page = gui.add_html(_IN_PAGE[False])
        widgets.on_user(self._choice, lambda _: self._take())
        toggle = gui.add_command("Next tool", hotkey="P", description="What a click does")
        widgets.on_user(toggle, lambda _: self._next_tool(), event="on_trigger")

    def _handler(self, modifier: str | None) -> Any:
        async def clicked(event: Any) -> None:  # viser takes coroutines too, which its annotation does not say
            click = Click.of(event.ray_origin, event.ray_direction)
            if click is not None:
                self.click(click, is_shifted=modifier == SHIFT)

        return clicked

    def _take(self) -> None:
        widgets.set_content(self._in_page, _IN_PAGE[self.tool.aims])
        if self._in_hand is not self.tool:
            self._in_hand.put_away()
            self._in_hand = self.tool

    def _next_tool(self) -> None:
        names = tuple(self._tools)
        self._choice.value = names[(names.index(self.tool.name) + 1) % len(names)]
        self._take()
        self._client.add_notification("Tool", f"A click {self.tool.name}.", auto_close_seconds=2.5)
