"""Places to look at the scan from, by name: the usual ones, and those that people keep with the project.

PROJECT/views.json holds the latter, for all recordings: they are about the room.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gazeloc_core.arrays import Floats
from gazeloc_core.errors import InputError
from gazeloc_core.scan import Mesh
from gazeloc_core.storage.files import read_json, write_json_atomically
from gazeloc_core.surfaces.viewpoint import FOV_RAD, overview, room_corners, up_vector

MAX_NAME, MAX_VIEWS = 60, 50
_FORMAT, _VERSION = "gazeloc-views", 1
Triple = tuple[float, float, float]


@dataclass(frozen=True)
class SavedView:
    """A camera's place: its eye and what it looks at, in the frame `scan` in metres, and its vertical field of view."""

    name: str
    eye: Triple
    target: Triple
    fov_rad: float = FOV_RAD

    def __post_init__(self) -> None:
        numbers = np.array([*self.eye, *self.target, self.fov_rad], dtype=np.float64)
        is_place = numbers.shape == (7,) and bool(np.isfinite(numbers).all()) and bool(np.abs(numbers).max() < 1e6)
        if not is_place or self.eye == self.target or not 0 < self.fov_rad < np.pi:
            raise InputError(f"The view {self.name!r} is no place to look from; save it again.")
        if not 0 < len(self.name) <= MAX_NAME:
            raise InputError(f"A view's name has 1 to {MAX_NAME} characters; this one has {len(self.name)}.")

    @classmethod
    def of(cls, name: str, eye: Any, target: Any, fov_rad: float = FOV_RAD) -> SavedView:
        """The view of these arrays (3,).

        Raises:
            InputError: if they are no place to look from, or the name is empty or long.
        """
        return cls(name, _triple(eye), _triple(target), float(fov_rad))


def usual_views(mesh: Mesh, up_axis: str) -> dict[str, SavedView]:
    """Start (from above a corner), and from the top, the front and the side, each with the whole room in it."""
    low, high = room_corners(mesh)
    up, middle = up_vector(up_axis), (low + high) / 2
    first, second = (np.eye(3)[axis] for axis in range(3) if up[axis] == 0)
    directions = {"Top": up - 1e-3 * second, "Front": -second, "Side": first}
    views = {"Start": SavedView.of("Start", *overview(mesh, up_axis))}
    for name, direction in directions.items():
        distance = _distance(high - low, direction)
        views[name] = SavedView.of(name, middle + distance * direction / np.linalg.norm(direction), middle)
    return views


def read_views(folder: Path) -> tuple[SavedView, ...]:
    """The views of a project folder, none where nobody saved any.

    Raises:
        InputError: if the file is damaged.
    """
    path = folder / "views.json"
    if not path.exists():
        return ()
    value = read_json(path, "saved views")
    try:
        if value["format"] != _FORMAT or value["version"] != _VERSION:
            raise InputError.of(path, f"written as {value['format']} {value['version']}", "update gazeloc")
        return views_from_json(value["views"])
    except (KeyError, TypeError, ValueError) as error:
        raise InputError.of(path, f"the saved views are damaged ({error})", "restore or remove it") from error


def write_views(folder: Path, views: tuple[SavedView, ...]) -> None:
    """Replace the views of a project folder."""
    value = {"format": _FORMAT, "version": _VERSION, "views": views_to_json(views)}
    write_json_atomically(folder / "views.json", value)


def views_to_json(views: tuple[SavedView, ...]) -> list[dict[str, Any]]:
    """Views as JSON."""
    return [
        {"name": view.name, "eye": list(view.eye), "target": list(view.target), "fov_rad": view.fov_rad}
        for view in views
    ]


def views_from_json(value: Any) -> tuple[SavedView, ...]:
    """The same again.

    Raises:
        InputError: if one is no place to look from.
        KeyError, TypeError, ValueError: if they are garbled.
    """
    return tuple(SavedView.of(str(v["name"]), v["eye"], v["target"], v["fov_rad"]) for v in value)


def _distance(size_m: Floats, direction: Floats) -> float:
    """How far from the middle of a box of this size it is all in view, with a tenth to spare."""
    half = size_m / 2
    along = np.abs(direction) > 0.5
    return 1.1 * float(np.linalg.norm(half[~along]) / np.tan(FOV_RAD / 2) + half[along].max())


def _triple(values: Any) -> Triple:
    x, y, z = (float(value) for value in values)
    return x, y, z
