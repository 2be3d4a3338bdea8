"""The process that draws: it owns the OpenGL context, the ray caster's tree and the recordings' frames.

Open3D holds Python's GIL for as long as it casts, and an EGL context belongs to one thread: both live in a process of
their own, so that the page stays alive while they work and a crash takes nothing along. It is started on the first
request and again after a crash.

    renderer = RenderProcess(Sources(mesh=partial(load_mesh, path), recordings={"walk": partial(open_recording, path)}))
    picture = await renderer.request(Render(camera=camera.to_json(), wxyz=..., center=...), key="client 3")
    points = renderer.submit(Cast(origins=..., directions=...)).result()

Of the requests with one key only the last is answered; the earlier ones that have not begun end as `Superseded`.
"""

from __future__ import annotations

import asyncio
import itertools
import logging
import multiprocessing
import threading
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any

from gazeloc_app.drawing.picture_cache import PictureCache
from gazeloc_app.drawing.render_jobs import Cast, Job, Sources
from gazeloc_app.drawing.render_worker import work
from gazeloc_core.errors import GazelocError, RenderError

_log = logging.getLogger(__name__)
_CACHE_BYTES = 192 * 1024 * 1024
_MAX_FAILED_STARTS = 3
_URGENT, _SOON, _NORMAL, _LATER = 0, 1, 2, 3


class Superseded(GazelocError):
    """A newer request with the same key came before this one was begun; nothing is wrong."""


class Closing(RenderError):
    """GazeLoc ends, so nothing is drawn any more; nothing is wrong."""

    def __init__(self) -> None:
        super().__init__("GazeLoc is closing; nothing is drawn any more.")


@dataclass(frozen=True)
class _Waiting:
    rank: tuple[int, int]
    job: Job
    key: str | None
    future: Future[Any]


class RenderProcess:
    """Answers `Render`, `Frame`, `Photo`, `Cast`, `Describe` one after the other; `Cast` first, it belongs to a click.

    `on_trouble(sentence)` is called from another thread when the process died and was started again.
    """

    def __init__(self, sources: Sources, on_trouble: Callable[[str], None] = _log.warning):
        self._sources = sources
        self._on_trouble = on_trouble
        self._context = multiprocessing.get_context("spawn")
        self._changed = threading.Condition()
        self._waiting: list[_Waiting] = []
        self._numbers = itertools.count()
        self._cache = PictureCache(_CACHE_BYTES)
        self._closed = False
        self._process: BaseProcess | None = None
        self._pipe: Connection | None = None
        self._deaths_in_a_row = 0
        self._is_outdated = False
        self._supervisor = threading.Thread(target=self._supervise, name="render supervisor", daemon=True)
        self._supervisor.start()

    def submit(
        self, job: Job, key: str | None = None, *, is_later: bool = False, is_urgent: bool = False
    ) -> Future[Any]:
        """The answer to come: JPEG bytes (`Render`, `Frame`), a `CastAnswer`, or a `Description`.

        One that `is_later` waits until nothing else does, one that `is_urgent` for no other picture. With a `key`,
        requests with that key which have not begun end as `Superseded`. The future raises `RenderError` where the
        process died, and what reading the frame raised.
        """
        future: Future[Any] = Future()
        future.set_running_or_notify_cancel()  # a waiting job is dropped by its key, not by cancelling
        cached = self._cache.get(job)
        with self._changed:
            dropped = [w for w in self._waiting if key is not None and w.key == key]
            self._waiting = [w for w in self._waiting if w not in dropped]
            if self._closed:
                future.set_exception(Closing())
            elif cached is not None:
                future.set_result(cached)
            else:
                usual = _LATER if is_later else _SOON if is_urgent else _NORMAL
                rank = (_URGENT if isinstance(job, Cast) else usual, next(self._numbers))
                self._waiting.append(_Waiting(rank, job, key, future))
                self._changed.notify()
        for waiting in dropped:
            waiting.future.set_exception(Superseded("A newer picture was asked for."))
        return future

    async def request(self, job: Job, key: str | None = None) -> Any:
        """`submit` for the event loop."""
        return await asyncio.wrap_future(self.submit(job, key))

    def reopen(self) -> None:
        """Open mesh and recordings anew before the next request: they have changed, and so have all pictures."""
        self._is_outdated = True  # before the cache: what is drawn from now on is kept, and so must be new
        self._cache.clear()

    @property
    def pid(self) -> int | None:
        """The process's number, None while it is not running."""
        return self._process.pid if self._process is not None and self._process.is_alive() else None

    def close(self) -> None:
        """End the process; requests that wait raise `RenderError`."""
        with self._changed:
            self._closed = True
            waiting, self._waiting = self._waiting, []
            self._changed.notify()
        for one in waiting:
            one.future.set_exception(Closing())
        process = self._process
        if process is not None and process.is_alive():
            process.kill()
        self._supervisor.join(timeout=5)

    def _supervise(self) -> None:
        """Hand one job after the other to the process: the only thread that touches it and its pipe."""
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._waiting or self._closed)
                if self._closed:
                    break
                one = min(self._waiting, key=lambda waiting: waiting.rank)
                self._waiting.remove(one)
            try:
                one.future.set_result(self._answer(one.job))
            except BaseException as error:
                one.future.set_exception(error)
        self._end_process()

    def _end_process(self) -> None:
        """End the process, whose pipe closes first so that it can leave by itself."""
        if self._pipe is not None:
            self._pipe.close()
            self._pipe = None
        if self._process is not None:
            self._process.join(timeout=2)
            self._process.kill()

    def _answer(self, job: Job) -> Any:
        cached = self._cache.get(job)  # the same picture may have been drawn while this one waited
        if cached is not None:
            return cached
        revision = self._cache.revision
        pipe = self._connected()
        try:
            pipe.send(job)
            done, answer = pipe.recv()
        except (EOFError, OSError) as error:
            raise self._died(job) from error
        self._deaths_in_a_row = 0
        if not done:
            raise answer
        self._cache.put(job, answer, revision)
        return answer

    def _connected(self) -> Connection:
        if self._is_outdated:
            self._is_outdated = False
            self._end_process()
        if self._pipe is None:
            if self._deaths_in_a_row >= _MAX_FAILED_STARTS:
                raise RenderError(
                    f"The process that draws died {self._deaths_in_a_row} times in a row and is not started again; "
                    "see the log, then start GazeLoc again."
                )
            self._pipe, theirs = self._context.Pipe()
            self._process = self._context.Process(
                target=work, args=(theirs, self._sources), name="gazeloc-render", daemon=True
            )
            self._process.start()
            theirs.close()
        return self._pipe

    def _died(self, job: Job) -> RenderError:
        """Clear up after the process, so that the next request starts it again, and say what happened."""
        assert self._process is not None
        assert self._pipe is not None
        self._process.join(timeout=5)
        self._process.kill()
        self._pipe.close()
        self._pipe = None
        self._deaths_in_a_row += 1
        sentence = (
            f"The process that draws died while it worked on a {type(job).__name__.lower()} "
            f"(exit code {self._process.exitcode}); it is started again with the next picture."
        )
        if self._closed:
            return Closing()
        self._on_trouble(sentence)
        return RenderError(sentence)
