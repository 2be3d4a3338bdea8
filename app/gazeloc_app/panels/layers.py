"""Panel: which layers show, and their tints."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from viser import GuiApi

from gazeloc_app import widgets
from gazeloc_app.actions.action import Action
from gazeloc_app.actions.views import ShowLayer, TintLayer, UseSafeColors
from gazeloc_app.palette import USUAL, Cameras
from gazeloc_app.panels.legend import legend_html
from gazeloc_app.panels.strokes import Strokes
from gazeloc_app.state import AppState, Layer, LayerSettings

HINTS = {
    Layer.SCAN: "The mesh in its own colours.",
    Layer.POINTS: "The sparse points of the glasses' reconstruction; where they stand before it is aligned is a guess.",
    Layer.SCAN_TAGS: "Tags as the phone saw them, blue.",
    Layer.SFM_TAGS: "Tags as the glasses saw them, orange, numbers with a prime (3′).",
    Layer.PHONE: "The phone's cameras, {}.",
    Layer.TRUTH: "The glasses' true poses, {}, where the project was given any.",
    Layer.ESTIMATE: "The glasses' estimated poses, {}; the frame that is shown, yellow.",
    Layer.KEYPOINTS: "Clicked points: orange on the scan, blue in the reconstruction, purple the selected pair.",
    Layer.TAG_POINTS: "The reconstruction's points under tags; those that the paper's filter drops are grey.",
    Layer.ERRORS: "Lines from the estimated cameras to the true ones, coloured by their length.",
    Layer.GRID: "Squares of one metre on the floor, and the scan's axes; an arrow marks the one that is up.",
    Layer.PEOPLE: "Where the others who are here look from, in their colours.",
    Layer.GAZE: "Where the wearer looked at the frame that is shown.",
}
_NAMED = (Layer.TRUTH, Layer.ESTIMATE, Layer.PHONE)
"""Whose colours have words in `palette.Cameras.words`."""
TINTABLE = (Layer.SCAN, Layer.POINTS, Layer.PHONE, Layer.TRUTH, Layer.ESTIMATE)


class LayerPanel:
    """A checkbox per layer that has something to show; one colour field for the layer that is to be tinted."""

    def __init__(
        self,
        gui: GuiApi,
        dispatch: Callable[[Action], None],
        facts: Callable[[AppState], tuple[str, ...]],
        contents: Callable[[AppState], Sequence[Layer]],
    ):
        """`facts(state)` are sentences about what is drawn with less than there is; `contents(state)` the layers that
        have something to show.
        """
        self._facts, self._contents, self._dispatch = facts, contents, dispatch
        self._strokes = Strokes()
        self._legend = gui.add_html("")
        self._boxes = {}
        for layer in Layer:
            box = gui.add_checkbox(layer.value, LayerSettings().is_visible(layer), hint=_hint(layer, USUAL))
            widgets.on_user(box, partial(_show, dispatch, layer))
            self._boxes[layer] = box
        self._safe = gui.add_checkbox(
            "Colours for colour-blind eyes",
            False,
            hint="Ground truth blue, estimates orange, methods likewise; in all browsers, kept for the next time.",
        )
        widgets.on_user(self._safe, lambda event: dispatch(UseSafeColors(bool(event.target.value))))
        self._note = gui.add_html("")
        with gui.add_folder("Tint", expand_by_default=False):
            self._which = gui.add_dropdown(
                "Layer", tuple(layer.value for layer in TINTABLE), hint="What the colour is for."
            )
            self._color = gui.add_rgb("Colour", (255, 160, 60), hint="Instead of the layer's own colours.")
            self._own = gui.add_button("Own colours", hint="Take the tint away.")
        widgets.on_user(self._color, self._tint)
        widgets.on_user(self._own, lambda _: dispatch(TintLayer(Layer(self._which.value), None)), event="on_click")

    def _tint(self, event: Any) -> None:
        layer = Layer(self._which.value)
        self._dispatch(TintLayer(layer, _rgb(event.target.value), self._strokes.of((layer, event.client_id))))

    def render(self, state: AppState) -> None:
        """Show the state's layers."""
        layers = self._contents(state)
        widgets.set_content(self._legend, legend_html(state, layers))
        tintable = tuple(layer.value for layer in TINTABLE if layer in layers)
        if tuple(self._which.options) != tintable:
            self._which.options = tintable
        for layer, box in self._boxes.items():
            widgets.set_property(box, "visible", layer in layers)
            widgets.set_value(box, state.layers.is_visible(layer))
            widgets.set_property(box, "hint", _hint(layer, state.cameras))
        widgets.set_value(self._safe, state.are_colors_safe)
        facts = "<br>".join(widgets.text(fact) for fact in self._facts(state))
        widgets.set_content(self._note, widgets.box(facts) if facts else "")


def _hint(layer: Layer, cameras: Cameras) -> str:
    return HINTS[layer].format(*(word for named, word in zip(_NAMED, cameras.words, strict=True) if named is layer))


def _show(dispatch: Callable[[Action], None], layer: Layer, event: Any) -> None:
    dispatch(ShowLayer(layer, bool(event.target.value)))


def _rgb(value: object) -> tuple[int, int, int]:
    red, green, blue = (min(max(int(channel), 0), 255) for channel in value)  # type: ignore[attr-defined]
    return red, green, blue
