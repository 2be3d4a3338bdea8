"""The socket of one visitor, with the limits and the list of messages applied to it."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable
from typing import Any

from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed, InvalidHandshake
from websockets.frames import CloseCode
from websockets.http11 import Response

from gazeloc_app.door import limits
from gazeloc_app.door.messages import FileTransferPart, FileTransferStartUpload, Refused, read_message
from gazeloc_app.door.uploads import PageUploads, Underway

log = logging.getLogger(__name__)


class Crowd:
    """All connections of one server."""

    def __init__(self) -> None:
        self.underway = Underway()
        self.pages = 0
        self._waiting: dict[VisitorConnection, asyncio.TimerHandle] = {}
        self._open = 0

    @property
    def is_full(self) -> bool:
        """Whether no further page may connect."""
        return self.pages >= limits.MAX_PAGES

    def connect(self, *parts: Any, **options: Any) -> VisitorConnection:
        """A new connection, as `websockets` asks for it."""
        return VisitorConnection(self, *parts, **options)

    def arrived(self, visitor: VisitorConnection) -> None:
        """Begin to wait for what the visitor wants: no longer than a while, and for no more than some at a time.

        Where too many wait, the eldest goes: an honest browser asks in its first milliseconds, so that a crowd that
        says nothing cannot keep it out.
        """
        self._open += 1
        if self._open > limits.MAX_CONNECTIONS:
            visitor.transport.abort()
            return
        if len(self._waiting) >= limits.MAX_WAITING:
            eldest = next(iter(self._waiting))
            self.asked(eldest)
            eldest.transport.abort()
        timer = visitor.loop.call_later(limits.REQUEST_TIMEOUT_S, visitor.transport.abort)
        self._waiting[visitor] = timer

    def asked(self, visitor: VisitorConnection) -> None:
        """The visitor said what it wants, or has gone."""
        timer = self._waiting.pop(visitor, None)
        if timer is not None:
            timer.cancel()

    def left(self, visitor: VisitorConnection) -> None:
        """The visitor has gone."""
        self.asked(visitor)
        self._open -= 1

    def limited(self, handler: Callable[[Any], Awaitable[None]]) -> Callable[[Any], Awaitable[None]]:
        """viser's handler of a page, for no more pages than there may be."""

        async def handle(visitor: VisitorConnection) -> None:
            if self.is_full:
                await visitor.close(CloseCode.TRY_AGAIN_LATER, "GazeLoc is open in too many pages; close one.")
                return
            self.pages += 1
            try:
                await handler(visitor)
            finally:
                self.pages -= 1
                visitor.uploads.close()

        return handle


class VisitorConnection(ServerConnection):
    """A connection whose `recv` returns only messages that a page may send."""

    def __init__(self, crowd: Crowd, *parts: Any, **options: Any):
        super().__init__(*parts, **options)
        self._answer_only_who_waits()
        self.uploads = PageUploads(crowd.underway)
        self._crowd = crowd
        self._pace = limits.Pace()
        self._refused = 0
        self._sent_away: asyncio.Task[None] | None = None

    def _answer_only_who_waits(self) -> None:
        """A page that is left while a picture is drawn for it closes its connection, which `websockets` asserts not."""
        protocol, answer = self.protocol, self.protocol.send_response

        def send_response(response: Response) -> None:
            if not protocol.eof_sent:
                answer(response)

        protocol.send_response = send_response  # type: ignore[method-assign]

    async def handshake(self, *parts: Any, **options: Any) -> None:
        """The answer to the request; who leaves meanwhile, or asks for nonsense, is no fault to be logged as one."""
        try:
            await super().handshake(*parts, **options)
        except (ConnectionClosed, InvalidHandshake) as error:
            self._forget(error)
        except AssertionError as error:  # `websockets` asserts that nobody leaves while the answer is drawn
            if self.close_deadline is None:
                raise
            self._forget(error)

    def _forget(self, error: Exception) -> None:
        log.info("a visitor left before its answer, or asked for nonsense (%r)", error)
        self.transport.abort()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Part of asyncio's protocol."""
        super().connection_made(transport)
        self._crowd.arrived(self)

    def connection_lost(self, exc: Exception | None) -> None:
        """Part of asyncio's protocol."""
        self._crowd.left(self)
        super().connection_lost(exc)

    def process_event(self, event: Any) -> None:
        """The first event is the request."""
        self._crowd.asked(self)
        super().process_event(event)

    async def recv(self, decode: bool | None = None) -> Any:
        """The next message that is allowed; others are dropped, and too many of them end the connection."""
        while True:
            raw = await super().recv(decode)
            await self._pace.wait()
            if self._sent_away is not None:
                continue  # reads on until the visitor's answer to the closing comes
            try:
                self._check(raw)
                return raw
            except Refused as refused:
                log.warning("a message of a page was refused: %s", refused)
                self._refused += 1
            if self._refused >= limits.MAX_REFUSED:
                reason = "GazeLoc does not understand this page; load it again."
                self._sent_away = asyncio.create_task(self.close(CloseCode.POLICY_VIOLATION, reason))

    def _check(self, raw: str | bytes) -> None:
        if isinstance(raw, str):
            raise Refused("text; messages are bytes")
        message = read_message(raw)
        if isinstance(message, FileTransferStartUpload):
            self.uploads.begin(message)
        elif isinstance(message, FileTransferPart):
            self.uploads.add(message)
