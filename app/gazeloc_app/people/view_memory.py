"""What each browser looked at last: its camera, tool and frame, so that a reload or a lost connection comes back to it.

Kept by the id that the page keeps for its tab, in memory and in PROJECT/.views.json, which a restart reads.
"""

from __future__ import annotations

import logging
import math
import threading
from collections import OrderedDict
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from gazeloc_core.errors import GazelocError
from gazeloc_core.storage.files import read_json, write_json_atomically

MAX_BROWSERS = 50
_log = logging.getLogger(__name__)
Vector = tuple[float, float, float]


@dataclass(frozen=True)
class View:
    """One browser's view: the camera in the frame `scan`, the tool by its name, the frame that is looked through."""

    position: Vector
    look_at: Vector
    up: Vector
    fov_rad: float
    tool: str
    recording: str | None = None
    """The recording of the frame that is looked through, None for one of the phone's."""
    frame: int | None = None
    """None for the room from outside."""


class ViewMemory:
    """The last views of up to `MAX_BROWSERS` browsers. Safe to use from several threads."""

    def __init__(self, folder: Path):
        self._path = folder / ".views.json"
        self._lock = threading.Lock()
        self._views: OrderedDict[str, View] = OrderedDict()
        self._is_changed = False
        self._read()

    def get(self, browser: str) -> View | None:
        """A browser's last view."""
        with self._lock:
            return self._views.get(browser)

    def put(self, browser: str, view: View) -> None:
        """Remember a browser's view."""
        with self._lock:
            if self._views.get(browser) == view:
                return
            self._views[browser] = view
            self._views.move_to_end(browser)
            while len(self._views) > MAX_BROWSERS:
                self._views.popitem(last=False)
            self._is_changed = True

    def save(self) -> None:
        """Write what changed. A view that cannot be written is worth no more than a line in the log."""
        with self._lock:
            if not self._is_changed or not self._path.parent.is_dir():  # one made anew would hide that it was moved
                return
            self._is_changed = False
            values = {browser: asdict(view) for browser, view in self._views.items()}
        try:
            write_json_atomically(self._path, values)
        except (OSError, ValueError) as error:
            _log.warning("%s: the views could not be saved (%s)", self._path, error)

    def _read(self) -> None:
        if not self._path.exists():
            return
        try:
            values = read_json(self._path, "the browsers' views")
            self._views.update((str(browser), _view(value)) for browser, value in values.items())
        except (GazelocError, KeyError, TypeError, ValueError, AttributeError) as error:
            _log.warning("%s: the views are damaged and begin anew (%s)", self._path, error)
            self._views.clear()


def vector(values: Iterable[float]) -> Vector:
    """Three finite numbers.

    Raises:
        ValueError: if they are not.
    """
    x, y, z = (float(value) for value in values)
    if not all(map(math.isfinite, (x, y, z))):
        raise ValueError(f"not finite: {(x, y, z)}")
    return x, y, z


def _view(value: Any) -> View:
    fov = float(value["fov_rad"])
    if not 0 < fov < math.pi:
        raise ValueError(f"no field of view: {fov}")
    recording, frame = value["recording"], value["frame"]
    return View(
        vector(value["position"]),
        vector(value["look_at"]),
        vector(value["up"]),
        fov,
        str(value["tool"]),
        None if recording is None else str(recording),
        None if frame is None else int(frame),
    )
