"""One connection of a page: its browser, what it shows of the other people, and the view that it has."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import viser

from gazeloc_app.browser import Browser
from gazeloc_app.panels.people import PeopleBar
from gazeloc_app.people.view_memory import View, vector
from gazeloc_app.scene.people import PeopleLayer


@dataclass
class Visit:
    """`tab` is the page's own id, known once it said hello."""

    client: viser.ClientHandle
    browser: Browser
    people: PeopleBar
    onlookers: PeopleLayer
    tab: str | None = None
    _first_view: View | None = field(init=False)

    def __post_init__(self) -> None:
        self._first_view = self.view

    def view_to_keep(self) -> View | None:
        """The view to come back to; None until it was another than the first, which is viser's own."""
        view = self.view
        if view == self._first_view:
            return None
        self._first_view = None  # from now on it is one that somebody went back to
        return view

    @property
    def view(self) -> View | None:
        """What the page looks at; None where it has not said yet, or nonsense."""
        camera, target = self.client.camera, self.browser.looking.target
        try:
            position, look_at, up = vector(camera.position), vector(camera.look_at), vector(camera.up_direction)
            fov = float(camera.fov)
        except (AssertionError, ValueError):
            return None
        recording, frame = (None, None) if target is None else (target.recording, target.frame)
        return View(position, look_at, up, fov, self.browser.tool.name, recording, frame)

    def come_back(self, view: View) -> None:
        """Take a view that this page had, with its tool."""
        self._stand(view)
        self.browser.take_again(view.tool)
        if view.frame is not None:
            self.browser.look_again(view.recording, view.frame)

    def go_to(self, view: View) -> None:
        """Look at what somebody else looks at; the tool stays."""
        self.browser.leave()
        self._stand(view)
        if view.frame is not None:
            self.browser.look_again(view.recording, view.frame)

    def _stand(self, view: View) -> None:
        camera: Any = self.client.camera
        with self.client.atomic():
            camera.up_direction = view.up
            camera.position = view.position
            camera.look_at = view.look_at
            camera.fov = view.fov_rad
