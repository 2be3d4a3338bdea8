"""What people decided as JSON, field by field, so that a step of the history holds only what it changed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any

from gazeloc_app.annotation.layers_json import layers_from_json, layers_to_json
from gazeloc_app.state import Annotation, Layer
from gazeloc_core.errors import InputError
from gazeloc_core.frames.marks import FrameMarks
from gazeloc_core.keypoints import KeypointSet
from gazeloc_core.methods import Method
from gazeloc_core.surfaces.glb import Rgb
from gazeloc_core.surfaces.layer_colors import checked_color
from gazeloc_core.surfaces.saved_views import views_from_json, views_to_json


def tints_to_json(tints: tuple[tuple[Layer, Rgb], ...]) -> dict[str, list[int]]:
    """Layers' colours by their names."""
    return {layer.value: list(tint) for layer, tint in tints}


def tints_from_json(value: Any) -> tuple[tuple[Layer, Rgb], ...]:
    """The same again.

    Raises:
        ValueError: if a layer is unknown, or a colour is none.
    """
    return tuple((Layer(name), checked_color(color)) for name, color in value.items())


Codec = tuple[Callable[[Any], Any], Callable[[Any], Any]]
CODECS: dict[str, Codec] = {
    "keypoints": (KeypointSet.to_json, KeypointSet.from_json),
    "marks": (FrameMarks.to_json, FrameMarks.from_json),
    "method": (lambda method: method.value, Method),
    "views": (views_to_json, views_from_json),
    "layers": (layers_to_json, layers_from_json),
    "tints": (tints_to_json, tints_from_json),
}
"""To JSON and back, for fields that are not JSON themselves."""


def _as_it_is(value: Any) -> Any:
    return value


def changes_to_json(before: Annotation, after: Annotation) -> dict[str, Any]:
    """The fields of `after` that differ from `before`."""
    changed = (field.name for field in fields(Annotation) if getattr(before, field.name) != getattr(after, field.name))
    return {name: CODECS.get(name, (_as_it_is, _as_it_is))[0](getattr(after, name)) for name in changed}


def changed_from_json(before: Annotation, changes: Any) -> Annotation:
    """`before` with the changes of `changes_to_json`.

    Raises:
        InputError: if they are garbled or of a later version.
    """
    try:
        values = {name: CODECS.get(name, (_as_it_is, _as_it_is))[1](value) for name, value in changes.items()}
        return replace(before, **values)
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise InputError(f"A step of the history is garbled ({error}).") from error
