"""What happens inside the drawing process: it answers the jobs of render_jobs.py, one after the other."""

from __future__ import annotations

import logging
import signal
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from gazeloc_app.drawing.jpeg import jpeg_of
from gazeloc_app.drawing.render_jobs import (
    Cast,
    CastAnswer,
    Describe,
    Description,
    Frame,
    Job,
    MakeDisplay,
    Photo,
    Render,
    Sources,
    camera_from_text,
)
from gazeloc_core.arrays import Bytes
from gazeloc_core.errors import GazelocError, InputError, RenderError
from gazeloc_core.frames.sources import FrameSource
from gazeloc_core.frames.undistort import Undistorter
from gazeloc_core.frames.video_cursor import VideoCursor, cursor_of
from gazeloc_core.recording import Recording
from gazeloc_core.scan import read_image
from gazeloc_core.surfaces.display_mesh import shaded
from gazeloc_core.surfaces.raycast import Raycaster
from gazeloc_core.surfaces.render import RayRenderer, Rendered, Renderer, open_renderer
from gazeloc_core.tags.drawing import draw_tags, drawn_tags
from gazeloc_core.transforms import rigid_from_wxyz

_log = logging.getLogger(__name__)


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


def _fitted(rgb: Bytes, width: int) -> Bytes:
    """The picture scaled down to `width`, unchanged where it is not wider or `width` is 0."""
    if not 0 < width < rgb.shape[1]:
        return rgb
    height = max(1, round(rgb.shape[0] * width / rgb.shape[1]))
    return np.asarray(cv2.resize(rgb, (width, height), interpolation=cv2.INTER_AREA), np.uint8)
