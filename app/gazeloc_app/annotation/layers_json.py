"""What shows in the scene as JSON, and its file: PROJECT/layers.json, for all recordings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from gazeloc_app.state import Coloring, Layer, LayerSettings
from gazeloc_core.errors import InputError
from gazeloc_core.methods import Method
from gazeloc_core.storage.files import read_json, write_json_atomically

NAME = "layers.json"
_FORMAT, _VERSION = "gazeloc-layers", 1


def layers_to_json(layers: LayerSettings) -> dict[str, Any]:
    """All fields; a layer that a later version adds shows or not as that version has it."""
    return {
        "shown": [layer.value for layer in Layer if layers.is_visible(layer)],
        "hidden": [layer.value for layer in Layer if not layers.is_visible(layer)],
        "coloring": layers.coloring.value,
        "thinning": layers.thinning,
        "compared": [method.value for method in Method if method in layers.compared],
        "draws_tags": layers.draws_tags,
        "suggests": layers.suggests,
    }


def layers_from_json(value: Any) -> LayerSettings:
    """The same again; layers and methods that this version does not know are left out.

    Raises:
        KeyError, TypeError, ValueError: if it is garbled.
    """
    hidden, shown = ({Layer(name) for name in value[key] if name in tuple(Layer)} for key in ("hidden", "shown"))
    thinning = value["thinning"]
    if thinning is not None and (type(thinning) is not int or thinning < 1):
        raise ValueError(f"every {thinning!r}-th camera cannot be drawn")
    return LayerSettings(
        hidden=frozenset((LayerSettings().hidden - shown) | hidden),
        coloring=Coloring(value["coloring"]),
        thinning=thinning,
        compared=frozenset(Method(name) for name in value["compared"] if name in tuple(Method)),
        draws_tags=_switch(value["draws_tags"]),
        suggests=_switch(value["suggests"]),
    )


def read_layers(folder: Path) -> LayerSettings:
    """What shows in a project folder's scene; as usual where nobody changed anything.

    Raises:
        InputError: if the file is damaged.
    """
    path = folder / NAME
    if not path.exists():
        return LayerSettings()
    value = read_json(path, "what shows in the scene")
    try:
        if value["format"] != _FORMAT or value["version"] != _VERSION:
            raise InputError.of(path, f"written as {value['format']} {value['version']}", "update gazeloc")
        return layers_from_json(value["layers"])
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise InputError.of(path, f"what it says of layers is damaged ({error})", "restore or remove it") from error


def write_layers(folder: Path, layers: LayerSettings) -> None:
    """Replace what shows in a project folder's scene."""
    write_json_atomically(folder / NAME, {"format": _FORMAT, "version": _VERSION, "layers": layers_to_json(layers)})


def _switch(value: Any) -> bool:
    if not isinstance(value, bool):
        raise TypeError(f"{value!r} is neither true nor false")
    return value
