"""Panel part: where to look at the room from. Going there moves one browser's camera alone; saved views are shared."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import viser

from gazeloc_app import widgets
from gazeloc_app.actions.action import Action, Notify
from gazeloc_app.actions.places import RemoveView, RenameView, SaveView
from gazeloc_app.state import AppState, Level
from gazeloc_core.arrays import Floats
from gazeloc_core.errors import InputError
from gazeloc_core.surfaces.saved_views import MAX_NAME, SavedView

_GO, _RENAME, _REMOVE = "Go", "Rename", "Remove"


class ViewList:
    """The usual views, the saved ones, and saving another."""

    def __init__(
        self,
        server: viser.ViserServer,
        usual: Callable[[], Mapping[str, SavedView]],
        up: Floats,
        dispatch: Callable[[Action], None],
    ):
        """`usual()` are the views that every scan has; `up` (3,) is the scan's up."""
        self._server, self._usual, self._up, self._dispatch = server, usual, up, dispatch
        self._state: AppState | None = None
        self._rows: dict[str, Any] = {}
        self._folder = server.gui.add_folder("Views")
        with self._folder:
            go = server.gui.add_button_group(
                "Look from", ("Start", "Top", "Front", "Side"), hint="Moves the camera of your browser alone."
            )
            self._name: Any = server.gui.add_text(
                "New view", "", hint="A name for the view that you see now, or for a saved one."
            )
            save = server.gui.add_button("Save this view", hint="Kept with the project, for everybody.")
        widgets.on_user(go, lambda event: self._go(event, self._usual().get(str(event.target.value))), event="on_click")
        widgets.on_user(save, self._save, event="on_click")

    def render(self, state: AppState) -> None:
        """Show the state's saved views."""
        self._state = state
        names = [view.name for view in state.annotation.views]
        if names == list(self._rows):
            return
        for row in self._rows.values():
            row.remove()
        self._rows = {}
        with self._folder:
            for name in names:
                row = self._server.gui.add_button_group(
                    name,
                    (_GO, _RENAME, _REMOVE),
                    hint="A saved view: go to it, give it the name that stands in the field above, or forget it.",
                )
                widgets.on_user(row, partial(self._pressed, name), event="on_click")
                self._rows[name] = row

    def _pressed(self, name: str, event: Any) -> None:
        if str(event.target.value) == _REMOVE:
            self._dispatch(RemoveView(name))
        elif str(event.target.value) == _RENAME:
            self._rename(name)
        elif self._state is not None:
            self._go(event, next((view for view in self._state.annotation.views if view.name == name), None))

    def _go(self, event: Any, view: SavedView | None) -> None:
        client = self._server.get_clients().get(event.client_id)
        if client is None or view is None:
            return
        with client.atomic():
            client.camera.up_direction = self._up
            client.camera.fov = view.fov_rad
            client.camera.position = view.eye
            client.camera.look_at = view.target

    def _rename(self, name: str) -> None:
        new_name = self._typed()
        if new_name:
            self._dispatch(RenameView(name, new_name))
            self._name.value = ""
        else:
            self._dispatch(Notify(Level.INFO, f"Type the new name of “{name}” into the field “New view” first."))

    def _typed(self) -> str:
        return str(self._name.value).strip()[:MAX_NAME]

    def _save(self, event: Any) -> None:
        client = self._server.get_clients().get(event.client_id)
        if client is None or self._state is None:
            return
        name = self._typed() or f"View {len(self._state.annotation.views) + 1}"
        camera = client.camera
        try:
            self._dispatch(SaveView(SavedView.of(name, camera.position, camera.look_at, camera.fov)))
        except (InputError, TypeError, ValueError):
            self._dispatch(Notify(Level.WARNING, "This view cannot be saved; move the camera and try again."))
        self._name.value = ""
