"""A visitor of the app's server that is no browser: says whatever a test wants it to, byte by byte where needed."""

from __future__ import annotations

import asyncio
import contextlib
import http.client
import socket
from collections.abc import AsyncIterator
from typing import Any

import msgspec
import viser
import websockets.asyncio.client
import websockets.exceptions

PROTOCOL = f"viser-v{viser.__version__}"
CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": [1.0, 0.0, 0.0, 0.0],
    "position": [0.0, 0.0, 1],
    "fov": 0.8,
    "near": 0.01,
    "far": 1000,
    "image_height": 620,
    "image_width": 900,
    "look_at": [0, 0, 0],
    "up_direction": [0.0, 0.0, 1.0],
}
"""What a page sends first, whole numbers as its encoder writes them."""


def get(port: int, path: str = "/", *, to: str = "127.0.0.1", **headers: str) -> tuple[int, Any, bytes]:
    """Status, headers and body; `headers` override those of a plain browser, underscores stand for dashes."""
    connection = http.client.HTTPConnection(to, port, timeout=20)
    sent = {"Host": f"localhost:{port}"} | {name.replace("_", "-"): value for name, value in headers.items()}
    connection.request("GET", path, headers=sent)
    response = connection.getresponse()
    with contextlib.closing(connection):
        return response.status, response.headers, response.read()


def raw(port: int, sent: bytes, seconds: float = 5.0) -> bytes:
    """Everything that comes back for some bytes until the server closes, or is silent for so long."""
    with socket.create_connection(("127.0.0.1", port), timeout=seconds) as connection:
        connection.sendall(sent)
        parts = []
        with contextlib.suppress(TimeoutError, ConnectionError):
            while part := connection.recv(65536):
                parts.append(part)
    return b"".join(parts)


class Page:
    """A connection like that of the viewer's page."""

    def __init__(self, connection: Any):
        self.connection = connection
        self._reader = asyncio.create_task(self._read())

    async def _read(self) -> None:
        with contextlib.suppress(websockets.exceptions.ConnectionClosed):
            while True:
                await self.connection.recv()

    async def send(self, message: Any) -> None:
        """One message, as the page encodes it; bytes and text go as they are."""
        await self.connection.send(message if isinstance(message, bytes | str) else msgspec.msgpack.encode(message))

    async def close_code(self, seconds: float = 10.0) -> int | None:
        """The code with which the server closed the connection, None where it is still open."""
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(self.connection.wait_closed(), seconds)
        return self.connection.close_code


@contextlib.asynccontextmanager
async def page(port: int, *, host: str | None = None, origin: str | None = "", **headers: str) -> AsyncIterator[Page]:
    """A connected page; an empty `origin` is the right one, None is none."""
    host = host or f"localhost:{port}"
    sent = {name.replace("_", "-"): value for name, value in headers.items()}
    connection = await websockets.asyncio.client.connect(
        f"ws://{host}",
        host="127.0.0.1",
        port=port,
        origin=f"http://{host}" if origin == "" else origin,  # type: ignore[arg-type]
        additional_headers=sent,
        subprotocols=[PROTOCOL],  # type: ignore[list-item]
        max_size=None,
        close_timeout=1,
    )
    visitor = Page(connection)
    try:
        yield visitor
    finally:
        with contextlib.suppress(Exception):
            await connection.close()
        visitor._reader.cancel()


async def until(is_so: Any, seconds: float = 5.0) -> bool:
    """Whether something became so in time."""
    for _ in range(int(seconds / 0.02)):
        if is_so():
            return True
        await asyncio.sleep(0.02)
    return bool(is_so())
