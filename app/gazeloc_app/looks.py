"""One browser's look: light or dark, which that browser remembers, and the app's brand in both."""

from __future__ import annotations

import asyncio
import logging
from typing import Any

import numpy as np
import viser
from viser.theme import TitlebarConfig, TitlebarImage

from gazeloc_app.palette import BACKGROUND, BACKGROUND_DARK, BRAND, Rgb

log = logging.getLogger(__name__)
_KEY = "gazeloc-look"
_ANSWER_S = 5.0
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
        brand_color=BRAND,
    )


def set_background(scene: viser.SceneApi, *, is_dark: bool = False) -> None:
    """What is behind the scene: neither white nor black, so that holes in a scan are seen as holes."""
    color: Rgb = BACKGROUND_DARK if is_dark else BACKGROUND
    scene.set_background_image(np.full((2, 2, 3), color, dtype=np.uint8), format="png")


class Look:
    """The look of one connected browser."""

    def __init__(self, client: viser.ClientHandle):
        self._client = client
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

    async def _toggled(self, _event: object) -> None:
        self.toggle()

    def _show(self, *, is_dark: bool) -> None:
        self._is_dark = is_dark
        with self._client.atomic():
            set_theme(self._client.gui, is_dark=is_dark)
            set_background(self._client.scene, is_dark=is_dark)
