"""Panel part: how many of the recording's cameras are drawn, what their colours stand for, and the legend."""

from __future__ import annotations

from collections.abc import Callable

from viser import GuiApi

from gazeloc_app import widgets
from gazeloc_app.actions.action import Action
from gazeloc_app.actions.views import MAX_THINNING, ColorCameras, ThinCameras
from gazeloc_app.palette import STATUSES, Rgb, hexadecimal
from gazeloc_app.panels.strokes import Strokes
from gazeloc_app.scene.cameras import SceneCameras
from gazeloc_app.state import AppState, Coloring
from gazeloc_core.charts.color_scale import NO_VALUE, ColorScale

_NONE = {
    Coloring.ERROR: "No frame has a ground truth to be measured against.",
    Coloring.SCORE: "These poses have no scores yet; they are made by the stage that scores frames.",
}


class CameraColors:
    """The slider, the choice of colours, and the legend."""

    def __init__(self, gui: GuiApi, cameras: SceneCameras, dispatch: Callable[[Action], None]):
        self._cameras = cameras
        with gui.add_folder("Cameras"):
            self._coloring = gui.add_dropdown(
                "Colour by",
                tuple(coloring.value for coloring in Coloring),
                hint="Method: one colour for each. Status: how a frame came by its pose. "
                "Error: distance from the ground truth. Agreement: how well frame and render agree, more is better.",
            )
            self._legend = gui.add_html("")
            self._thinning = gui.add_slider(
                "Every n-th", 1, MAX_THINNING, 1, 1, hint="How many of the recording's cameras are drawn."
            )
            self._automatic = gui.add_button(
                "As many as fit", hint="Leave it to their number: few enough to see the room.", color="gray"
            )
        widgets.on_user(self._coloring, lambda event: _color(dispatch, str(event.target.value)))
        strokes = Strokes()
        widgets.on_user(
            self._thinning,
            lambda event: dispatch(ThinCameras(int(event.target.value), strokes.of(event.client_id))),
        )
        widgets.on_user(self._automatic, lambda _: dispatch(ThinCameras(None)), event="on_click")

    def render(self, state: AppState) -> None:
        """Show the state's choice."""
        widgets.set_value(self._coloring, state.layers.coloring.value)
        widgets.set_value(self._thinning, min(self._cameras.thinning(state), MAX_THINNING))
        widgets.set_property(self._automatic, "disabled", state.layers.thinning is None)
        widgets.set_content(self._legend, legend(state.layers.coloring, self._cameras.scale(state)))


def _color(dispatch: Callable[[Action], None], name: str) -> None:
    if name in tuple(Coloring):
        dispatch(ColorCameras(Coloring(name)))


def legend(coloring: Coloring, scale: ColorScale | None) -> str:
    """What the colours mean, as HTML; "" where each method has its own."""
    if coloring is Coloring.SET:
        return ""
    if coloring is Coloring.STATUS:
        entries = [f"{_swatch(color)} {widgets.text(status.replace('_', ' '))}" for status, color in STATUSES.items()]
        return widgets.box(" &nbsp; ".join(entries))
    if scale is None:
        return widgets.box(_NONE[coloring])
    bar = f'<div style="height:10px;border-radius:2px;background:{ColorScale.css_gradient()}"></div>'
    low, high = f"{100 * scale.low:.4g} cm", f"{100 * scale.high:.4g} cm and more"
    if coloring is Coloring.SCORE:
        low, high = f"{scale.low:.2f} and less", f"{scale.high:.2f} and more"
    ends = f"<span>{low}</span><span>{high}</span>"
    row = f'<div style="display:flex;justify-content:space-between">{ends}</div>'
    return widgets.box(f"{bar}{row}{_swatch(NO_VALUE)} not known")


def _swatch(color: Rgb) -> str:
    return widgets.colored("■", hexadecimal(color))
