"""The viewer's web server with the door in front of it (door/), and our routes on the same port.

viser binds to all interfaces, checks neither Host nor Origin, lets a client overwrite any field of a widget and opens a
public tunnel when asked. This module and door/ close these, and are the only ones that use viser's private names; each
has a test in tests/app/test_server.py that fails when another version of viser lacks it.
"""

from __future__ import annotations

import contextlib
import inspect
import io
import socket
import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from http import HTTPStatus
from typing import Any

import viser
import websockets.asyncio.server
from viser import _gui_api, _messages
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from gazeloc_app.door.address import check_address
from gazeloc_app.door.connection import Crowd
from gazeloc_app.door.gui_values import is_offered, takes_files
from gazeloc_app.door.hosts import Hosts, Refusal, is_websocket, own_hosts
from gazeloc_app.door.limits import MAX_MESSAGE_BYTES
from gazeloc_app.door.login import Login, needs_token
from gazeloc_app.door.paths import is_plain
from gazeloc_app.looks import set_theme
from gazeloc_app.page import dress
from gazeloc_app.routes import Reply, Routes
from gazeloc_core.errors import InputError

_OPEN_TIMEOUT_S = 60
"""The handshake's limit covers our routes, and the first render waits for the mesh to load."""
_PAGE_POLICY = "; ".join(
    [
        "default-src 'self' 'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval' data: blob:",
        "frame-ancestors 'self'",
        "form-action 'self'",
        "base-uri 'none'",
        "object-src 'none'",
    ]
)
"""The page needs nothing from elsewhere, and so cannot be made to tell anything there."""
_constructing = threading.Lock()


@dataclass(frozen=True)
class Entrance:
    """Who may come in and what they find there."""

    hosts: Hosts
    login: Login | None
    routes: Routes
    title: str
    crowd: Crowd

    async def answer(self, viser_answer: Any, connection: Any, request: Request) -> Response | None:
        """The answer to a request, None where it becomes a page's connection."""
        refusal = self._refusal(connection, request)
        if refusal is not None:
            body = refusal.sentence.encode()
            return _response(Reply(body=body, content_type="text/plain; charset=utf-8", status=refusal.status))
        if self.login is not None:
            reply = await self.login.answer(request)
            if reply is not None:
                return _response(reply)
        if is_websocket(request):
            return None
        reply = await self.routes.answer(request.path)
        if reply is not None:
            return _response(reply)
        page: Response = viser_answer(connection, request)
        dress(page, request.path, self.title)
        page.headers["Content-Security-Policy"] = _PAGE_POLICY
        page.headers["Referrer-Policy"] = "same-origin"
        page.headers["X-Content-Type-Options"] = "nosniff"
        return page

    def _refusal(self, connection: Any, request: Request) -> Refusal | None:
        if not is_plain(request.path):
            return Refusal(status=HTTPStatus.NOT_FOUND, sentence="There is nothing under this path.")
        local = connection.local_address
        refusal = self.hosts.check(request, local[0] if local else None)
        if refusal is None and is_websocket(request) and self.crowd.is_full:
            sentence = "GazeLoc is open in too many pages at once; close one."
            return Refusal(status=HTTPStatus.SERVICE_UNAVAILABLE, sentence=sentence)
        return refusal


def make_server(
    port: int,
    routes: Routes,
    *,
    host: str = "127.0.0.1",
    title: str = "GazeLoc",
    allow_hosts: Sequence[str] = (),
    token: str | None = None,
) -> viser.ViserServer:
    """A running server; port 0 takes any free one (`server.get_port()`).

    `allow_hosts` are further names that a proxy gives the app. Who does not show `token` is not let in; None, which
    lets everybody in, is for the loopback only (`needs_token`).

    Raises:
        InputError: if `host` is no address, one of `allow_hosts` no name, or the port is taken or not allowed.
    """
    address = check_address(host)
    hosts = own_hosts(address, allow_hosts)
    assert token or not needs_token(host, allow_hosts), "others can reach this address, so it needs a token"
    listener = _listen(address, port)
    bound = listener.getsockname()[1]
    login = Login(bound, token) if token else None
    _guard_widgets()
    try:
        with (
            _serving_through(listener, Entrance(hosts, login, routes, title, Crowd())),
            contextlib.redirect_stdout(io.StringIO()),
        ):
            server = viser.ViserServer(host=address, port=bound, label=title, verbose=False)
    except BaseException:
        listener.close()
        raise
    _forbid_sharing(server)
    set_theme(server.gui)
    _set_even_light(server)
    return server


def _set_even_light(server: viser.ViserServer) -> None:
    """No lights, shadows or environment that would tint a scan; markers, which are not unlit, get it from all sides.

    static/page/true-colors.js is the other half: no tone mapping.
    """
    server.scene.configure_default_lights(False, cast_shadow=False)
    server.scene.configure_environment_map(None)
    server.scene.add_light_ambient("/light", intensity=3.0)


def _listen(address: str, port: int) -> socket.socket:
    """A bound socket: viser itself would move on in silence to the next free port."""
    listener = socket.socket(socket.AF_INET6 if ":" in address else socket.AF_INET)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((address, port))
        listener.listen()
    except (OSError, OverflowError) as error:
        listener.close()
        reason = error.strerror if isinstance(error, OSError) else "ports go from 0 to 65535"
        raise InputError(
            f"Port {port} cannot be used ({reason}); close the program that has it or choose another with --port."
        ) from error
    return listener


@contextlib.contextmanager
def _serving_through(listener: socket.socket, entrance: Entrance) -> Iterator[None]:
    """While this is open, the server that viser starts listens on `listener` and has `entrance` in front of it."""
    plain_serve = websockets.asyncio.server.serve

    def serve(handler: Any, _host: Any, _port: Any, *, process_request: Any, **options: Any) -> Any:
        async def answer(connection: Any, request: Request) -> Response | None:
            return await entrance.answer(process_request, connection, request)

        options |= {
            "max_size": MAX_MESSAGE_BYTES,
            "open_timeout": _OPEN_TIMEOUT_S,
            "create_connection": entrance.crowd.connect,
        }
        return plain_serve(entrance.crowd.limited(handler), sock=listener, process_request=answer, **options)

    with _constructing:
        websockets.asyncio.server.serve = serve  # type: ignore[assignment,misc]
        try:
            yield
        finally:
            websockets.asyncio.server.serve = plain_serve  # type: ignore[misc]


def _response(reply: Reply) -> Response:
    headers = Headers(
        {
            "Content-Type": reply.content_type,
            "Content-Length": str(len(reply.body)),
            "Cache-Control": f"private, max-age={reply.cache_s}" if reply.cache_s else "no-store",
            "Cross-Origin-Resource-Policy": "same-origin",
            "X-Content-Type-Options": "nosniff",
        }
        | dict(reply.headers)
    )
    return Response(reply.status, HTTPStatus(reply.status).phrase, headers, reply.body)


def _forbid_sharing(server: viser.ViserServer) -> None:
    """Hiding the button is not enough: any client can send the request, which opens a public tunnel."""
    server._websock_server.unregister_handler(_messages.ShareUrlRequest)
    server._websock_server.unregister_handler(_messages.ShareUrlDisconnect)


def _guard_widgets() -> None:
    """Drop what a browser sends to a widget but for values and files that it takes; viser would set any field of it.

    Must come before a server is made: its handlers are bound as it is.
    """
    plain, plain_start = _gui_api.GuiApi._handle_gui_updates, _gui_api.GuiApi._handle_file_transfer_start
    if getattr(plain, "is_guarded", False):
        return
    assert inspect.iscoroutinefunction(plain)

    async def values_only(self: Any, client_id: Any, message: Any) -> None:
        handle = self._gui_input_handle_from_uuid.get(message.uuid)
        if handle is not None and set(message.updates) == {"value"} and is_offered(handle, message.updates["value"]):
            await plain(self, client_id, message)

    def to_upload_buttons_only(self: Any, client_id: Any, message: Any) -> None:
        if takes_files(self._gui_input_handle_from_uuid.get(message.source_component_uuid)):
            plain_start(self, client_id, message)

    values_only.is_guarded = True  # type: ignore[attr-defined]
    _gui_api.GuiApi._handle_gui_updates = values_only  # type: ignore[method-assign]
    _gui_api.GuiApi._handle_file_transfer_start = to_upload_buttons_only  # type: ignore[method-assign]
