"""The legend of the scene: the colours of the layers that show, as they are now."""

from __future__ import annotations

from collections.abc import Sequence

from gazeloc_app import widgets
from gazeloc_app.palette import GAZE, SCAN_TAGS, SFM_TAGS, SHOWN_FRAME, UNDER, Rgb, hexadecimal
from gazeloc_app.state import AppState, Coloring, Layer


def legend_html(state: AppState, layers: Sequence[Layer]) -> str:
    """Of these layers those that are visible and have one colour; "" for none."""
    colors = {layer: color for layer, color in _colors(state).items() if layer in layers}
    entries = [_entry(color, layer.value) for layer, color in colors.items() if state.layers.is_visible(layer)]
    if Layer.ESTIMATE in layers and state.layers.is_visible(Layer.ESTIMATE):
        entries.append(_entry(SHOWN_FRAME, "Frame that is shown"))
    return f'<div class="gazeloc-legend">{"".join(entries)}</div>' if entries else ""


def _colors(state: AppState) -> dict[Layer, Rgb]:
    cameras, of_sets = state.cameras, state.layers.coloring is Coloring.SET
    colors = {Layer.ESTIMATE: cameras.estimate} if of_sets else {}  # else a scale of its own says it
    colors |= {Layer.TRUTH: cameras.truth if of_sets else UNDER, Layer.PHONE: cameras.phone}
    colors = {layer: state.annotation.tint(layer) or color for layer, color in colors.items()}
    return colors | {Layer.GAZE: GAZE, Layer.SCAN_TAGS: SCAN_TAGS, Layer.SFM_TAGS: SFM_TAGS}


def _entry(color: Rgb, name: str) -> str:
    return f'<span><i style="background:{hexadecimal(color)}"></i>{widgets.text(name)}</span>'
