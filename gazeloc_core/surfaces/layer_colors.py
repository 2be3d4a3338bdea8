"""The colours that people gave to layers of the scene: PROJECT/colors.json, for all recordings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from gazeloc_core.errors import InputError
from gazeloc_core.storage.files import read_json, write_json_atomically
from gazeloc_core.surfaces.glb import Rgb

_FORMAT, _VERSION = "gazeloc-layer-colors", 1


def read_layer_colors(folder: Path) -> dict[str, Rgb]:
    """The colours of a project folder by their layers' names, none where nobody chose any.

    Raises:
        InputError: if the file is damaged.
    """
    path = folder / "colors.json"
    if not path.exists():
        return {}
    value = read_json(path, "layers' colours")
    try:
        if value["format"] != _FORMAT or value["version"] != _VERSION:
            raise InputError.of(path, f"written as {value['format']} {value['version']}", "update gazeloc")
        return {str(name): checked_color(color) for name, color in value["colors"].items()}
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise InputError.of(path, f"the layers' colours are damaged ({error})", "restore or remove it") from error


def write_layer_colors(folder: Path, colors: dict[str, Rgb]) -> None:
    """Replace the colours of a project folder."""
    value = {"format": _FORMAT, "version": _VERSION, "colors": {name: list(color) for name, color in colors.items()}}
    write_json_atomically(folder / "colors.json", value)


def checked_color(value: Any) -> Rgb:
    """Three whole numbers from 0 to 255.

    Raises:
        ValueError: if they are none.
    """
    if not isinstance(value, list | tuple) or len(value) != 3:
        raise ValueError(f"{value!r} is no colour")
    if any(type(channel) is not int or not 0 <= channel <= 255 for channel in value):
        raise ValueError(f"{value!r} is no colour; channels go from 0 to 255")
    red, green, blue = value
    return red, green, blue
