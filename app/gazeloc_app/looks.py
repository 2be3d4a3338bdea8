"""One browser's look: light or dark, which that browser remembers, and the app's brand in both."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Sequence
from typing import Any

import numpy as np
import viser
from viser._messages import GuiSetPanelCollapsedMessage, GuiSetPanelWidthMessage
from viser.theme import TitlebarConfig, TitlebarImage

from gazeloc_app.palette import BACKGROUND, BACKGROUND_DARK, Rgb, theme_color

log = logging.getLogger(__name__)
_KEY = "gazeloc-look"
_ANSWER_S = 5.0
_SETTLED_S = 10.0
NARROW_PX = 320
"""A view of the room that is narrower than this, on a page that has just been opened, asks for narrower panels."""
TABLET_PANEL_PX = 320
UPRIGHT_PX = 150
"""Narrower still, as on a tablet that is held upright: the panels at the side begin folded up (the room keeps 120)."""
_LOGO = TitlebarImage(
    image_url_light="/static/logo-light.svg", image_url_dark="/static/logo-dark.svg", image_alt="GazeLoc", href=None
)


def set_theme(gui: viser.GuiApi, *, is_dark: bool = False) -> None:
    """The app's theme for all browsers (`server.gui`), or for one (`client.gui`)."""
    gui.configure_theme(
        titlebar_content=TitlebarConfig(buttons=None, image=_LOGO),
        dark_mode=is_dark,
        show_logo=False,
        show_share_button=False,
        brand_color=theme_color(is_dark=is_dark),
    )


def set_background(scene: viser.SceneApi, *, is_dark: bool = False) -> None:
    """What is behind the scene: neither white nor black, so that holes in a scan are seen as holes."""
    color: Rgb = BACKGROUND_DARK if is_dark else BACKGROUND
    scene.set_background_image(np.full((2, 2, 3), color, dtype=np.uint8), format="png")


def set_panel_width(client: viser.ClientHandle, panel: Any, width_px: float) -> None:
    """A panel's width in one browser; viser itself has it for all of them only.

    Raises nothing where the person has moved the panel: the page then keeps what it has.
    """
    gui = client.gui
    message = GuiSetPanelWidthMessage(
        panel._placement_uuid, width_px, counter=gui._next_layout_counter(), run_id=gui._layout_run_id
    )
    gui._websock_interface.queue_message(message)


def fold_panel(client: viser.ClientHandle, panel: Any) -> None:
    """Fold a panel up in one browser, as its own button does."""
    gui = client.gui
    message = GuiSetPanelCollapsedMessage(
        panel._placement_uuid, True, counter=gui._next_layout_counter(), run_id=gui._layout_run_id
    )
    gui._websock_interface.queue_message(message)


class Look:
    """The look of one connected browser; on a tablet its panels are narrower, so that something of the room is left.

    The first of `panels` is the main one; the others are folded up where there is no room for both.
    """

    def __init__(self, client: viser.ClientHandle, panels: Sequence[Any]):
        self._client, self._panels = client, panels
        self._until = time.monotonic() + _SETTLED_S
        self._is_narrow = self._is_folded = False
        client.camera.on_update(self._fit)
        self._is_dark = False
        toggle: Any = client.gui.add_command("Light or dark", description="The look of the app in this browser")
        toggle.on_trigger(self._toggled)

    def remember(self) -> None:
        """Bring back what this browser had when it was here last, once it has said so; runs on the event loop."""
        self._asking = asyncio.create_task(self._remember())

    async def _remember(self) -> None:
        try:
            known = await asyncio.to_thread(self._client.local_storage.get_item, _KEY, _ANSWER_S)
        except (RuntimeError, TimeoutError) as error:
            log.debug("the browser does not say which look it had: %s", error)
            return
        if known == "dark":
            self._show(is_dark=True)

    def toggle(self) -> None:
        """The other look, remembered by the browser."""
        self._show(is_dark=not self._is_dark)
        self._client.local_storage.set_item(_KEY, "dark" if self._is_dark else "light")

    async def _fit(self, camera: viser.CameraHandle) -> None:
        """Once, while the page still settles: later on its widths are the person's.

        Panels glide to their places, so that the room gets narrower by and by: each is looked for by itself.
        """
        if time.monotonic() > self._until:
            return
        if not self._is_narrow and camera.image_width < NARROW_PX:
            self._is_narrow = True
            for panel in self._panels:
                set_panel_width(self._client, panel, TABLET_PANEL_PX)
        if not self._is_folded and camera.image_width < UPRIGHT_PX:
            self._is_folded = True
            for panel in self._panels[1:]:
                fold_panel(self._client, panel)

    async def _toggled(self, _event: object) -> None:
        self.toggle()

    def _show(self, *, is_dark: bool) -> None:
        self._is_dark = is_dark
        with self._client.atomic():
            set_theme(self._client.gui, is_dark=is_dark)
            set_background(self._client.scene, is_dark=is_dark)
