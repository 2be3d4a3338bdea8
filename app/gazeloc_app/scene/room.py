"""The room: the scan's mesh in its true colours."""

from __future__ import annotations

import viser

from gazeloc_core.surfaces.glb import WHITE, Glb, Rgb


class RoomLayer:
    """The scan at `/scan`, as `gazeloc_core.surfaces.scan_display` makes it.

    Never attach a click handler to its node: that costs the browser 136 ms per mouse move at 1.5 million triangles.
    """

    def __init__(self, scene: viser.SceneApi):
        self._scene = scene
        self._glb: Glb | None = None
        self._look: tuple[Rgb, bool] = (WHITE, True)
        self._handle: viser.GlbHandle | None = None
        self._visible = True

    def show(self, glb: Glb | None) -> None:
        """Draw this instead; None draws nothing."""
        if glb is not self._glb:
            self._glb = glb
            self._draw()

    @property
    def is_empty(self) -> bool:
        """Whether nothing is drawn yet."""
        return self._glb is None

    def set_look(self, tint: Rgb = WHITE, two_sided: bool = True) -> None:
        """Tint all colours, or hide faces from behind (`two_sided` False)."""
        look = (tint, two_sided)
        if look != self._look:
            self._look = look
            self._draw()

    def set_visible(self, visible: bool) -> None:
        """Show or hide the layer."""
        self._visible = visible
        if self._handle is not None:
            self._handle.visible = visible

    def _draw(self) -> None:
        if self._glb is None:
            if self._handle is not None:
                self._handle.remove()
                self._handle = None
            return
        self._handle = self._scene.add_glb(
            "/scan",
            self._glb.to_bytes(*self._look),
            cast_shadow=False,
            receive_shadow=False,
            visible=self._visible,
        )
