"""One browser's widgets for looking through cameras: the phone's frames, the next that sees a keypoint, the way out.

They also draw the keypoints onto the picture that is looked through.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import numpy as np
import viser

from gazeloc_app import widgets
from gazeloc_app.actions.action import Action, Notify
from gazeloc_app.actions.picks import Side
from gazeloc_app.actions.views import ShowFrame
from gazeloc_app.data import ProjectData
from gazeloc_app.frames.frame_clicks import moved_in_frame
from gazeloc_app.frames.frame_marks import marks_in_frame, next_frame_seeing, view_of
from gazeloc_app.frames.looking import Looking, Target
from gazeloc_app.keypoints.picking import pixel_in_frame
from gazeloc_app.scene.frame_marks import FrameMarksLayer, on_plane
from gazeloc_app.scene.frames import PLANE_M
from gazeloc_app.state import AppState, Level


class LookingControls:
    """On one client's page."""

    def __init__(
        self,
        client: viser.ClientHandle,
        data: ProjectData,
        looking: Looking,
        state: Callable[[], AppState],
        dispatch: Callable[[Action], None],
    ):
        self._data, self._looking, self._state, self._dispatch = data, looking, state, dispatch
        self._marks = FrameMarksLayer(client.scene, self._drag)
        self._drawn: object = None
        self._drawing = threading.Lock()
        """The store's loop renders, and so does this page's wish on viser's."""
        photos, gui = len(data.scan().frames_with_images), client.gui
        self._phone: Any = gui.add_slider(
            "Phone's frame",
            0,
            max(photos - 1, 1),
            1,
            0,
            visible=photos > 1,
            hint="Look through the phone's camera, in this browser. Clicks there are exact: they need no mesh.",
        )
        self._next = gui.add_button(
            "Next frame that sees it",
            visible=False,
            color="gray",
            hint="Of the selected keypoint: goes to the next frame in whose picture it is, and nothing hides it.",
        )
        self._leave = gui.add_button("Leave the frame", visible=False, color="gray", hint="Back into the room.")
        self._picture = gui.add_checkbox(
            "Its picture",
            True,
            visible=False,
            hint="The frame's picture before the view. Without it clicks are on the scan.",
        )
        self._follow = gui.add_checkbox(
            "Follow the trajectory",
            True,
            visible=False,
            hint="In this browser: the view goes on with the frame, also while it plays. Off, it stays at this frame.",
        )
        widgets.on_user(self._picture, lambda event: self._show_picture(bool(event.target.value)))
        widgets.on_user(self._follow, lambda event: self._go_along(bool(event.target.value)))
        widgets.on_user(self._phone, lambda event: self._show_phone(int(event.target.value)))
        widgets.on_user(self._next, lambda _: self._go_on(), event="on_click")
        widgets.on_user(self._leave, lambda _: self.leave(), event="on_click")

    def leave(self) -> None:
        """Go back to the room."""
        self._looking.leave()
        self.render(self._state())

    def render(self, state: AppState) -> None:
        """Show what fits what is looked through, and the keypoints in it."""
        target = self._looking.target
        widgets.set_property(self._leave, "visible", target is not None)
        widgets.set_property(self._picture, "visible", target is not None)
        widgets.set_property(self._follow, "visible", target is not None and target.side is Side.SFM)
        selected = (
            state.selected_key if state.selected_key and state.annotation.keypoints.get(state.selected_key) else None
        )
        widgets.set_property(self._next, "visible", selected is not None)
        if target is not None and target.side is Side.SCAN:
            widgets.set_value(self._phone, target.frame)
        target = self._looking.pictured
        drawn = (target, state.annotation.keypoints, state.annotation.alignment, selected, state.data_revision)
        with self._drawing:
            if drawn != self._drawn:
                self._drawn = drawn
                self._draw(state, target, selected)

    def _draw(self, state: AppState, target: Target | None, selected: str | None) -> None:
        if target is None:
            self._marks.show(None, [], [], None)
            return
        view = view_of(self._data, state, target.side, target.frame)
        self._marks.show(view, *marks_in_frame(self._data, state, target.side, target.frame), selected)

    def _show_picture(self, is_on: bool) -> None:
        self._looking.show_picture(is_on)
        self.render(self._state())

    def _go_along(self, is_on: bool) -> None:
        self._looking.follows = is_on
        self._looking.follow(self._state())
        self.render(self._state())

    def _drag(self, key: str, event: Any) -> None:
        """A click in the picture is dragged: its mark follows, and where it is let go counts, as one step."""
        state, target = self._state(), self._looking.target
        view = None if target is None else view_of(self._data, state, target.side, target.frame)
        if view is None or target is None:
            return
        eye = np.asarray(event.client.camera.position)
        ray = np.asarray(event.end_position) - eye
        pixel = pixel_in_frame(view.camera, view.scan_from_camera, eye, ray, PLANE_M) if ray.any() else None
        if event.phase == "end":
            self._drawn = None  # where nothing comes of it, the mark goes back
            at = None if pixel is None else (float(pixel[0]), float(pixel[1]))
            actions = [] if at is None else moved_in_frame(self._data, state, target.side, key, target.frame, at)
            for action in actions or [Notify(Level.INFO, "That is beside the frame; the click stays where it was.")]:
                self._dispatch(action)
        elif pixel is not None:
            event.target.opacity = 0.35  # it is not seen else
            event.target.position = on_plane(view, np.array([pixel]))[0]

    def _show_phone(self, frame: int) -> None:
        if 0 <= frame < len(self._data.scan().frames_with_images):
            self._looking.look_with_phone(frame)
            self.render(self._state())

    def _go_on(self) -> None:
        state, target = self._state(), self._looking.target
        pair = state.annotation.keypoints.get(state.selected_key) if state.selected_key else None
        if pair is None:
            return
        needs_scan = pair.scan is None and len(self._data.scan().frames_with_images) > 0
        side = target.side if target is not None else Side.SCAN if needs_scan else Side.SFM
        after = target.frame if target is not None else -1 if side is Side.SCAN else state.frame
        frame = next_frame_seeing(self._data, state, side, after)
        if frame is None:
            text = f"No other frame of the {'phone' if side is Side.SCAN else 'glasses'} sees “{pair.name}”."
            self._dispatch(Notify(Level.INFO, text))
        elif side is Side.SCAN:
            self._show_phone(frame)
        else:
            self._dispatch(ShowFrame(frame))
            self._looking.look(frame)
            self.render(state)
