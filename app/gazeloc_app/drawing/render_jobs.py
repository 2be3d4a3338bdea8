"""What the drawing process can be asked for, and what it answers: values that are sent between processes."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TypeAlias

from gazeloc_core.arrays import Floats
from gazeloc_core.camera import Camera
from gazeloc_core.recording import Recording
from gazeloc_core.scan import Mesh
from gazeloc_core.tag_types import TagSightings


@dataclass(frozen=True, eq=False)
class SeenTags:
    """The tags in a recording's undistorted frames, and their size in metres where it is known."""

    sightings: TagSightings
    size_m: float | None


@dataclass(frozen=True)
class Sources:
    """How the process opens what it draws: functions that can be pickled, e.g. `functools.partial(load_mesh, path)`."""

    mesh: Callable[[], Mesh]
    recordings: Mapping[str, Callable[[], Recording]] = field(default_factory=dict)
    tags: Mapping[str, Callable[[], SeenTags]] = field(default_factory=dict)
    """What `Frame.with_tags` draws, by recording."""
    make_display: Callable[[], object] | None = None
    """Makes the scan fit for the screen and keeps it."""


@dataclass(frozen=True, kw_only=True)
class Render:
    """A picture of the scan: JPEG bytes. `camera` is `Camera.to_json()` as a string, so that requests can be compared.

    `wxyz` and `center` are the pose `scan_from_camera`; `width` scales the picture, 0 leaves it.
    """

    camera: str
    wxyz: tuple[float, float, float, float]
    center: tuple[float, float, float]
    width: int = 0


@dataclass(frozen=True, kw_only=True)
class Frame:
    """A recording's frame: JPEG bytes, undistorted unless `as_recorded`; `width` scales it down, 0 leaves it.

    `with_tags` draws the tags that were found in it, with outline, id, axes and a cube.
    """

    recording: str
    index: int
    as_recorded: bool = False
    with_tags: bool = False
    width: int = 0


@dataclass(frozen=True, kw_only=True)
class Photo:
    """A picture of the scan's, as stored: JPEG bytes. `camera` is its camera as `Camera.to_json()`, as a string."""

    path: str
    camera: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Cast:
    """Rays `origins` and `directions` (N, 3) in the frame `scan` against the scan's mesh: a `CastAnswer`."""

    origins: Floats
    directions: Floats


@dataclass(frozen=True, eq=False)
class CastAnswer:
    """`points` (N, 3) in scan and unit `normals` (N, 3), NaN for a miss; `distance` (N,), inf for a miss."""

    points: Floats
    normals: Floats
    distance: Floats


@dataclass(frozen=True, kw_only=True)
class Describe:
    """Load the mesh and start the renderer now: a `Description`. Ask it first, so that the first click is quick."""


@dataclass(frozen=True)
class Description:
    """`by` names the renderer of pinhole views; `note` is the sentence to show where it is the alternative, else ""."""

    by: str
    note: str


@dataclass(frozen=True, kw_only=True)
class MakeDisplay:
    """Make the scan fit for the screen and keep it in the project: None."""


Job: TypeAlias = Render | Frame | Photo | Cast | Describe | MakeDisplay


def camera_text(camera: Camera) -> str:
    """The camera as `Render.camera` takes it."""
    return json.dumps(camera.to_json(), sort_keys=True)


def camera_from_text(text: str) -> Camera:
    """The camera of `camera_text`."""
    return Camera.from_json(json.loads(text))
