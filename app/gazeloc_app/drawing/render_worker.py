"""What happens inside the drawing process: jobs that can be sent there, and their answers."""

from __future__ import annotations

import json
import logging
import signal
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, TypeAlias

import cv2
import numpy as np

from gazeloc_core.arrays import Bytes, Floats
from gazeloc_core.camera import Camera
from gazeloc_core.errors import GazelocError, InputError, RenderError
from gazeloc_core.frames.sources import FrameSource
from gazeloc_core.frames.undistort import Undistorter
from gazeloc_core.frames.video_cursor import VideoCursor, cursor_of
from gazeloc_core.recording import Recording
from gazeloc_core.scan import Mesh, read_image
from gazeloc_core.surfaces.display_mesh import shaded
from gazeloc_core.surfaces.raycast import Raycaster
from gazeloc_core.surfaces.render import RayRenderer, Rendered, Renderer, open_renderer
from gazeloc_core.tag_types import TagSightings
from gazeloc_core.tags.drawing import draw_tags, drawn_tags
from gazeloc_core.transforms import rigid_from_wxyz

JPEG_QUALITY = 90
_log = logging.getLogger(__name__)


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


def work(pipe: Connection, sources: Sources) -> None:
    """Answer jobs from the pipe with (True, answer) or (False, error) until the other end is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the app, which then ends this process
    studio = _Studio(sources)
    while True:
        try:
            job = pipe.recv()
        except (EOFError, OSError):
            return
        try:
            answer: tuple[bool, Any] = (True, studio.answer(job))
        except GazelocError as error:
            answer = (False, error)
        except Exception as error:
            _log.exception("drawing failed")
            answer = (False, RenderError(f"Drawing failed: {type(error).__name__}: {error}."))
        try:
            pipe.send(answer)
        except OSError:  # the app is gone
            return


class _Studio:
    """Everything that the process holds, opened when it is first needed."""

    def __init__(self, sources: Sources):
        self._sources = sources
        self._raycaster: Raycaster | None = None
        self._renderer: Renderer | None = None
        self._rays: RayRenderer | None = None
        self._recordings: dict[str, tuple[Recording, FrameSource | VideoCursor, Undistorter]] = {}
        self._last_read: tuple[tuple[str, int, bool], Bytes] | None = None

    def answer(self, job: Job) -> Any:
        match job:
            case Render():
                return jpeg_of(self._render(job).rgb)
            case Frame():
                return jpeg_of(_fitted(self._frame(job), job.width))
            case Photo():
                return jpeg_of(read_image(Path(job.path), camera_from_text(job.camera)))
            case Cast():
                return self._cast(job)
            case Describe():
                renderer = self._pinhole_renderer()
                return Description(renderer.by, renderer.note)
            case MakeDisplay():
                assert self._sources.make_display is not None
                self._sources.make_display()
                return None

    def _caster(self) -> Raycaster:
        if self._raycaster is None:
            self._raycaster = Raycaster(shaded(self._sources.mesh()))
            self._raycaster.cast([[0, 0, 0]], [[0, 0, 1]])  # Open3D builds its tree on the first ray
        return self._raycaster

    def _pinhole_renderer(self) -> Renderer:
        if self._renderer is None:
            caster = self._caster()
            self._renderer = open_renderer(caster.mesh, caster)
        return self._renderer

    def _render(self, job: Render) -> Rendered:
        camera = camera_from_text(job.camera)
        if job.width:
            camera = camera.scaled(job.width, max(1, round(job.width * camera.height / camera.width)))
        pose = rigid_from_wxyz(job.wxyz, job.center, "the view's pose")
        if camera.is_pinhole:
            return self._pinhole_renderer().render(camera, pose)
        if self._rays is None:
            self._rays = RayRenderer(self._caster().mesh, raycaster=self._caster())
        return self._rays.render(camera, pose)

    def _frame(self, job: Frame) -> Bytes:
        if job.recording not in self._sources.recordings:
            raise InputError(f"There is no recording {job.recording!r}.")
        if job.recording not in self._recordings:
            opened = self._sources.recordings[job.recording]()
            self._recordings[job.recording] = (opened, cursor_of(opened.frames), Undistorter.of(opened.camera))
        recording, frames, undistorter = self._recordings[job.recording]
        if not 0 <= job.index < len(recording):
            raise InputError(f"There is no frame {job.index}; the recording {job.recording!r} has {len(recording)}.")
        image = self._read(job, frames, undistorter)
        if job.with_tags and not job.as_recorded and job.recording in self._sources.tags:
            seen = self._sources.tags[job.recording]()
            tags = drawn_tags(seen.sightings, job.index, undistorter.target, seen.size_m)
            image = draw_tags(image, tags, undistorter.target, seen.size_m)
        return image

    def _read(self, job: Frame, frames: FrameSource | VideoCursor, undistorter: Undistorter) -> Bytes:
        """The frame, as recorded or undistorted; the last one is kept, as pages ask for it quickly and then in full."""
        what = (job.recording, job.index, job.as_recorded)
        if self._last_read is None or self._last_read[0] != what:
            image = frames.read(job.index)
            self._last_read = (what, image if job.as_recorded else undistorter.image(image))
        return self._last_read[1]

    def _cast(self, job: Cast) -> CastAnswer:
        caster = self._caster()
        hits = caster.cast(job.origins, job.directions)
        return CastAnswer(caster.points(hits), caster.normals(hits), hits.distance)


def camera_text(camera: Camera) -> str:
    """The camera as `Render.camera` takes it."""
    return json.dumps(camera.to_json(), sort_keys=True)


def camera_from_text(text: str) -> Camera:
    """The camera of `camera_text`."""
    return Camera.from_json(json.loads(text))


def jpeg_of(rgb: Bytes) -> bytes:
    """A picture (H, W, 3) as JPEG."""
    done, data = cv2.imencode(".jpg", cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    if not done:
        raise RenderError(f"A picture of {rgb.shape[1]}x{rgb.shape[0]} pixels cannot be written as JPEG.")
    return bytes(data)


def _fitted(rgb: Bytes, width: int) -> Bytes:
    """The picture scaled down to `width`, unchanged where it is not wider or `width` is 0."""
    if not 0 < width < rgb.shape[1]:
        return rgb
    height = max(1, round(rgb.shape[0] * width / rgb.shape[1]))
    return np.asarray(cv2.resize(rgb, (width, height), interpolation=cv2.INTER_AREA), np.uint8)
