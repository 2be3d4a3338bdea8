"""A tool: what a click in the scene makes, for one browser. A new one is one file here and one line in all.py.

Every browser has its own tools, so a tool may keep what it needs between clicks (a measuring tape its first end), and
draw what only this browser shall see with `bench.client.scene`. Dragging orbits with every tool and never makes
anything.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import viser
from numpy.typing import ArrayLike

from gazeloc_app.actions.action import Action
from gazeloc_app.data import ProjectData
from gazeloc_app.frames.looking import Looking
from gazeloc_app.keypoints import picking
from gazeloc_app.keypoints.snapping import NEAR_PX, Snapped, snap
from gazeloc_app.scene.cut import Cut
from gazeloc_app.state import AppState
from gazeloc_core.arrays import Floats, frozen
from gazeloc_core.camera import Camera
from gazeloc_core.keypoints import Point
from gazeloc_core.tag_types import TagCorners
from gazeloc_core.transforms import Similarity


@dataclass(frozen=True, eq=False)
class Click:
    """The ray of a click in the frame `scan`: `origin` (3,) in metres, and `direction` (3,) of any length."""

    origin: Floats
    direction: Floats

    @classmethod
    def of(cls, origin: ArrayLike, direction: ArrayLike) -> Click | None:
        """The click that a browser reports; None for numbers that are no ray."""
        try:
            start, ray = frozen(origin), frozen(direction)
        except (TypeError, ValueError):
            return None
        is_ray = start.shape == ray.shape == (3,) and bool(np.isfinite([start, ray]).all())
        return cls(start, ray) if is_ray and np.linalg.norm(ray) > 1e-12 else None


@dataclass(frozen=True, eq=False)
class Bench:
    """What the tools of one browser work with.

    `front()` says which side of the scan's faces is drawn (see `picking.pick_mesh`); `moves()` whether a click shall
    move the selected keypoint's point, `snaps()` whether one near a tag's centre or corner means that.
    """

    client: viser.ClientHandle
    data: ProjectData
    looking: Looking
    state: Callable[[], AppState]
    dispatch: Callable[[Action], None]
    front: Callable[[], int]
    moves: Callable[[], bool]
    cut: Cut
    snaps: Callable[[], bool] = lambda: True

    def tolerance_rad(self) -> float:
        """The angle within which a click in this browser's view means a thing."""
        height = max(int(self.client.camera.image_height), 1)
        return picking.tolerance_rad(float(self.client.camera.fov), height)

    def reach_px(self, camera: Camera) -> float:
        """How far beside a tag's corner a click may be, in pixels of the picture of the camera looked through."""
        return float(np.mean(camera.focal_px) * np.tan(self.tolerance_rad()) * NEAR_PX / picking.CLICK_RADIUS_PX)

    def snapped(
        self, click: Click, tags: TagCorners | None, scan_from_tags: Similarity, hit_in_scan: Floats | None
    ) -> Snapped | None:
        """The tag's place that a click means; None where it means none, or snapping is off."""
        if not self.snaps():
            return None
        tolerance = self.tolerance_rad() * NEAR_PX / picking.CLICK_RADIUS_PX
        return snap(tags, scan_from_tags, click.origin, click.direction, tolerance, hit_in_scan, self.cut.kept)

    def point_on_scan(self, click: Click) -> Point | None:
        """Where a click meets the scan, in metres; None beside it."""
        found = picking.pick_mesh(self.data.raycaster(), click.origin, click.direction, self.front(), self.cut.kept)
        return None if found is None else as_point(found)


class Tool:
    """What a click makes. `name` completes the sentence "A click ..."; `hint` says in one more what it is good for."""

    name: ClassVar[str]
    hint: ClassVar[str]
    aims: ClassVar[bool] = True
    """Whether a click means a spot, so that the page shows its lens at the pointer."""

    def __init__(self, bench: Bench):
        self.bench = bench

    def click(self, click: Click) -> Action | None:
        """What a click makes; None for nothing that others need to know."""
        raise NotImplementedError

    def put_away(self) -> None:
        """Another tool was taken: what this one drew for its browser goes."""


def as_point(values: Any) -> Point:
    """Three numbers as a keypoint keeps them."""
    x, y, z = (float(value) for value in values)
    return x, y, z
