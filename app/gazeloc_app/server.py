"""The door: the viewer's web server, on the loopback only, for our own page only, with our routes on the same port.

viser binds to all interfaces, checks neither Host nor Origin, lets a client overwrite any field of a widget and opens a
public tunnel when asked. This module closes these, and is the only one that uses viser's private names; each has a
test in tests/app/test_server.py that fails when another version of viser lacks it. Who may come in is a list of checks
(`Check`), so that a login becomes one more of them.
"""

from __future__ import annotations

import contextlib
import inspect
import io
import re
import socket
import threading
from collections.abc import Callable, Iterator, Sequence
from http import HTTPStatus
from typing import Any

import viser
import websockets.asyncio.server
from viser import _gui_api, _messages
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from gazeloc_app.gui_values import is_offered
from gazeloc_app.loopback import check_loopback
from gazeloc_app.page import dress
from gazeloc_app.routes import Reply, Routes
from gazeloc_core.errors import InputError

MAX_MESSAGE_BYTES = 4 * 1024 * 1024
"""Largest message that a browser may send; the biggest honest one is a part of an upload, half a megabyte."""
_OPEN_TIMEOUT_S = 60
"""The handshake's limit covers our routes, and the first render waits for the mesh to load."""
_LOOPBACK_NAME = re.compile(r"(localhost|127\.0\.0\.1|\[::1\])(:[0-9]{1,5})?", re.IGNORECASE)
_constructing = threading.Lock()

Check = Callable[[Request], str | None]
"""Looks at a request before anything is answered: None lets it in, a sentence refuses it."""


def make_server(
    port: int,
    routes: Routes,
    *,
    host: str = "127.0.0.1",
    title: str = "GazeLoc",
    dark_mode: bool = False,
    checks: Sequence[Check] = (),
) -> viser.ViserServer:
    """A running server on the loopback; port 0 takes any free one (`server.get_port()`).

    `checks` come after the check of Host and Origin.

    Raises:
        InputError: if `host` is not the loopback, or the port is taken or not allowed.
    """
    listener = _listen(host, port)
    try:
        with (
            _serving_through(listener, routes, (own_page_only, *checks), title),
            contextlib.redirect_stdout(io.StringIO()),
        ):
            server = viser.ViserServer(host=host, port=listener.getsockname()[1], label=title, verbose=False)
    except BaseException:
        listener.close()
        raise
    _forbid_sharing(server)
    _accept_values_only()
    server.gui.configure_theme(
        dark_mode=dark_mode, show_logo=False, show_share_button=False, brand_color=(28, 110, 140)
    )
    _set_even_light(server)
    return server


def _set_even_light(server: viser.ViserServer) -> None:
    """No lights, shadows or environment that would tint a scan; markers, which are not unlit, get it from all sides.

    static/page/true-colors.js is the other half: no tone mapping.
    """
    server.scene.configure_default_lights(False, cast_shadow=False)
    server.scene.configure_environment_map(None)
    server.scene.add_light_ambient("/light", intensity=3.0)


def own_page_only(request: Request) -> str | None:
    """Let in our own page in a browser on this machine: guards against other pages and against DNS rebinding.

    The Host must be a loopback name (any port: `ssh -L` may change it). A websocket must come from a page of the very
    same origin. Another site's page may link here, but may not embed our page or pictures.
    """
    hosts = request.headers.get_all("Host")
    if len(hosts) != 1 or not _LOOPBACK_NAME.fullmatch(hosts[0]):
        return "GazeLoc answers on this machine only; open it as http://localhost."
    origins = request.headers.get_all("Origin")
    if origins and origins != [f"http://{hosts[0]}"]:
        return "Another page may not talk to GazeLoc."
    if is_websocket(request):
        return None if origins else "GazeLoc's connection is for its own page in a browser."
    site = request.headers.get("Sec-Fetch-Site", "none")
    is_link = request.headers.get("Sec-Fetch-Dest") == "document"
    if site not in ("same-origin", "none") and not is_link:
        return "Another page may not show GazeLoc's pictures."
    return None


def is_websocket(request: Request) -> bool:
    """Whether the browser asks to upgrade the connection."""
    return "websocket" in (value.lower() for value in request.headers.get_all("Upgrade"))


def _listen(host: str, port: int) -> socket.socket:
    """A bound socket: viser itself would move on in silence to the next free port."""
    address = check_loopback(host)
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
def _serving_through(listener: socket.socket, routes: Routes, checks: Sequence[Check], title: str) -> Iterator[None]:
    """While this is open, the server that viser starts listens on `listener` and asks `checks` and `routes` first."""
    plain_serve = websockets.asyncio.server.serve

    def serve(handler: Any, _host: Any, _port: Any, *, process_request: Any, **options: Any) -> Any:
        options |= {"max_size": MAX_MESSAGE_BYTES, "open_timeout": _OPEN_TIMEOUT_S}
        answer = _request_handler(process_request, routes, checks, title)
        return plain_serve(handler, sock=listener, process_request=answer, **options)

    with _constructing:
        websockets.asyncio.server.serve = serve  # type: ignore[assignment,misc]
        try:
            yield
        finally:
            websockets.asyncio.server.serve = plain_serve  # type: ignore[misc]


def _request_handler(viser_answer: Any, routes: Routes, checks: Sequence[Check], title: str) -> Any:
    async def answer(connection: Any, request: Request) -> Response | None:
        refusal = next((sentence for check in checks if (sentence := check(request))), None)
        if refusal is not None:
            body = refusal.encode()
            return _response(Reply(body=body, content_type="text/plain; charset=utf-8", status=403))
        if is_websocket(request):
            return None
        reply = await routes.answer(request.path)
        if reply is not None:
            return _response(reply)
        page: Response = viser_answer(connection, request)
        dress(page, request.path, title)
        page.headers["Content-Security-Policy"] = "frame-ancestors 'self'"
        return page

    return answer


def _response(reply: Reply) -> Response:
    headers = Headers(
        {
            "Content-Type": reply.content_type,
            "Content-Length": str(len(reply.body)),
            "Cache-Control": f"private, max-age={reply.cache_s}" if reply.cache_s else "no-store",
            "Cross-Origin-Resource-Policy": "same-origin",
            "X-Content-Type-Options": "nosniff",
        }
    )
    return Response(reply.status, HTTPStatus(reply.status).phrase, headers, reply.body)


def _forbid_sharing(server: viser.ViserServer) -> None:
    """Hiding the button is not enough: any client can send the request, which opens a public tunnel."""
    server._websock_server.unregister_handler(_messages.ShareUrlRequest)
    server._websock_server.unregister_handler(_messages.ShareUrlDisconnect)


def _accept_values_only() -> None:
    """Drop a browser's changes to a widget but for values that it offers; viser would set even its callbacks."""
    plain = _gui_api.GuiApi._handle_gui_updates
    if getattr(plain, "is_guarded", False):
        return
    assert inspect.iscoroutinefunction(plain)

    async def guarded(self: Any, client_id: Any, message: Any) -> None:
        handle = self._gui_input_handle_from_uuid.get(message.uuid)
        if handle is not None and set(message.updates) == {"value"} and is_offered(handle, message.updates["value"]):
            await plain(self, client_id, message)

    guarded.is_guarded = True  # type: ignore[attr-defined]
    _gui_api.GuiApi._handle_gui_updates = guarded  # type: ignore[method-assign]
