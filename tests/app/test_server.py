"""The door: who comes in, and the private names of viser that it stands on."""

import asyncio
import gzip
import http.client
import inspect
import socket
import struct
import time

import pytest
import viser
import websockets.asyncio.client
import websockets.asyncio.server
import websockets.exceptions
import websockets.protocol
from gazeloc_app.door.limits import MAX_MESSAGE_BYTES
from gazeloc_app.routes import Reply, Routes
from gazeloc_app.server import make_server
from viser import _gui_api, _messages

from gazeloc_core.errors import InputError


@pytest.fixture(scope="module")
def server():
    routes = Routes()

    async def hello(asked):
        return Reply(body=f"hello {asked.names['who']}".encode(), content_type="text/plain", cache_s=9)

    async def slow(asked):
        await asyncio.sleep(1.0)
        return Reply(body=b"slow", content_type="text/plain")

    routes.get("/hello/{who}", hello)
    routes.get("/slow", slow)
    server = make_server(0, routes)
    yield server
    server.stop()


def get(server, path="/", **headers):
    """Status, headers and body; `headers` override those of a plain browser, underscores stand for dashes."""
    connection = http.client.HTTPConnection("127.0.0.1", server.get_port(), timeout=20)
    sent = {"Host": f"localhost:{server.get_port()}"} | {k.replace("_", "-"): v for k, v in headers.items()}
    connection.request("GET", path, headers=sent)
    response = connection.getresponse()
    return response.status, response.headers, response.read()


def connect(server, origin="http://localhost:{port}", host=None):
    """A websocket as the page opens it; awaits the first message."""
    port = server.get_port()

    async def talk():
        async with websockets.asyncio.client.connect(
            f"ws://localhost:{port}",
            origin=origin.format(port=port) if origin else None,
            additional_headers={} if host is None else {"Host": host},
            subprotocols=[f"viser-v{viser.__version__}"],
            max_size=None,
        ) as connection:
            return await connection.recv()

    return asyncio.run(talk())


def test_the_page_and_our_routes_are_on_one_port(server):
    assert get(server)[0] == 200
    status, headers, body = get(server, "/hello/you")
    assert (status, body) == (200, b"hello you")
    assert headers["Cache-Control"] == "private, max-age=9"
    assert headers["Cross-Origin-Resource-Policy"] == "same-origin"
    assert get(server, "/no/such/page")[0] == 404


def test_a_slow_route_does_not_hold_up_the_others(server):
    async def both():
        slow = asyncio.create_task(asyncio.to_thread(get, server, "/slow"))
        await asyncio.sleep(0.2)
        await asyncio.to_thread(get, server, "/hello/you")
        assert not slow.done()
        return await slow

    assert asyncio.run(both())[2] == b"slow"


@pytest.mark.parametrize("leave", [socket.socket.close, lambda visitor: visitor.shutdown(socket.SHUT_WR)])
def test_who_leaves_before_the_answer_leaves_no_traceback_in_the_log(server, caplog, leave):
    with socket.create_connection(("127.0.0.1", server.get_port())) as visitor:
        visitor.sendall(f"GET /slow HTTP/1.1\r\nHost: localhost:{server.get_port()}\r\n\r\n".encode())
        time.sleep(0.3)
        leave(visitor)
        time.sleep(1.2)
    assert [record.getMessage() for record in caplog.records if record.levelname == "ERROR"] == []
    assert get(server)[0] == 200


@pytest.mark.parametrize("reset", [True, False])
@pytest.mark.parametrize("asked", ["", "GET", "GET /slow HTTP/1.1\r\nHost: localhost\r\n\r\n", "nonsense\r\n\r\n"])
def test_crowds_that_leave_at_any_moment_leave_no_traceback_in_the_log(server, caplog, asked, reset):
    for i in range(12):
        with socket.create_connection(("127.0.0.1", server.get_port())) as visitor:
            visitor.sendall(asked.encode())
            time.sleep(0.004 * (i % 4))
            if reset:
                visitor.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            elif i % 2:
                visitor.shutdown(socket.SHUT_WR)
                time.sleep(0.01)
    time.sleep(1.2)
    assert [record.getMessage() for record in caplog.records if record.levelname == "ERROR"] == []
    assert get(server)[0] == 200


@pytest.mark.parametrize("host", ["localhost", "127.0.0.1:9000", "[::1]:8080", "LOCALHOST:1"])
def test_any_loopback_name_and_port_may_be_asked_for(server, host):
    assert get(server, Host=host)[0] == 200


@pytest.mark.parametrize("host", ["evil.example", "localhost.evil.example", "127.0.0.1.evil:80", "", "10.0.0.1:8080"])
def test_another_host_is_refused_so_that_dns_rebinding_fails(server, host):
    for path in ("/", "/hello/you"):
        status, _, body = get(server, path, Host=host)
        assert status == 403
        assert b"this machine only" in body


def test_another_sites_page_may_not_embed_ours_but_may_link_to_it(server):
    for kind in ("image", "iframe", "empty"):
        assert get(server, "/hello/you", Sec_Fetch_Site="cross-site", Sec_Fetch_Dest=kind)[0] == 403
    assert get(server, "/", Sec_Fetch_Site="same-site", Sec_Fetch_Dest="iframe")[0] == 403
    assert get(server, "/", Sec_Fetch_Site="cross-site", Sec_Fetch_Dest="document")[0] == 200
    assert get(server, "/hello/you", Sec_Fetch_Site="cross-site", Sec_Fetch_Dest="document")[0] == 403
    assert get(server, "/hello/you", Sec_Fetch_Site="same-origin", Sec_Fetch_Dest="image")[0] == 200
    assert get(server, "/hello/you", Origin="http://evil.example")[0] == 403
    assert "frame-ancestors 'self'" in get(server)[1]["Content-Security-Policy"]


def test_our_own_page_may_connect(server):
    assert isinstance(connect(server), bytes)


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "ftp://localhost:{port}", "http://localhost:1", None, "null"]
)
def test_no_other_page_may_connect(server, origin):
    with pytest.raises(websockets.exceptions.InvalidStatus) as refused:
        connect(server, origin)
    assert refused.value.response.status_code == 403


def test_a_rebound_name_may_not_connect_even_with_its_own_origin(server):
    with pytest.raises(websockets.exceptions.InvalidStatus):
        connect(server, "http://evil.example:80", host="evil.example:80")


@pytest.mark.parametrize("host", ["example.org", "", "127.0.0.1:8080", "http://localhost"])
def test_an_address_is_an_address(host):
    with pytest.raises(InputError, match="this is not an address"):
        make_server(0, Routes(), host=host)


def test_it_listens_on_the_loopback_only(server):
    listening = server._websock_server._host
    assert listening == "127.0.0.1"
    with socket.socket() as other:  # another loopback address is another interface's stand-in
        other.settimeout(2)
        assert other.connect_ex(("127.0.0.2", server.get_port())) != 0


def test_a_taken_port_is_said_and_not_moved_from(server):
    with pytest.raises(InputError, match=f"Port {server.get_port()} cannot be used"):
        make_server(server.get_port(), Routes())


@pytest.mark.parametrize("port", [-1, 65536])
def test_a_port_that_cannot_be_is_a_sentence(port):
    with pytest.raises(InputError, match="0 to 65535"):
        make_server(port, Routes())


def test_a_message_that_is_too_large_closes_only_its_own_connection(server):
    port = server.get_port()

    async def talk():
        # Not `async with`: closing what the server has closed already is an error inside of asyncio now and then.
        connection = await websockets.asyncio.client.connect(
            f"ws://localhost:{port}",
            origin=f"http://localhost:{port}",
            subprotocols=[f"viser-v{viser.__version__}"],
            max_size=None,
        )
        try:
            await connection.send(b"x" * (MAX_MESSAGE_BYTES + 1))
            while True:
                await connection.recv()
        except websockets.exceptions.ConnectionClosed as closed:
            return closed.rcvd.code

    assert asyncio.run(talk()) == 1009
    assert isinstance(connect(server), bytes)


def test_a_client_cannot_ask_for_a_public_tunnel(server):
    handlers = server._websock_server._incoming_handlers
    assert _messages.ShareUrlRequest not in handlers
    assert _messages.ShareUrlDisconnect not in handlers


def test_a_client_changes_the_value_of_a_widget_and_nothing_else(server):
    slider = server.gui.add_slider("s", 0, 10, 1, 3)
    seen = []
    slider.on_update(lambda event: seen.append(event))

    def send(updates):
        message = _messages.GuiUpdateMessage(slider._impl.uuid, updates)
        asyncio.run(server.gui._handle_gui_updates(0, message))

    send({"value": 5})
    assert slider.value == 5
    for updates in ({"update_cb": []}, {"removed": True}, {"value": 7, "disabled": True}, {"nonsense": 1}):
        send(updates)
    assert slider.value == 5
    assert slider._impl.update_cb
    assert not slider._impl.removed
    slider.remove()


def test_viser_still_has_the_private_names_that_the_door_stands_on(server):
    assert viser.__version__ == "1.1.1"
    assert "process_request" in inspect.signature(websockets.asyncio.server.serve.__init__).parameters
    assert "websockets.asyncio.server.serve(" in inspect.getsource(viser.infra._infra)
    assert callable(server._websock_server.unregister_handler)
    assert inspect.iscoroutinefunction(_gui_api.GuiApi._handle_gui_updates)
    assert "update_cb" in inspect.getsource(_gui_api.GuiApi._finish_file_upload)
    assert "await websocket.recv()" in inspect.getsource(viser.infra._infra._message_consumer)


def test_websockets_still_has_the_names_that_the_door_stands_on():
    plain = websockets.asyncio.server.ServerConnection
    assert "create_connection" in inspect.signature(websockets.asyncio.server.serve.__init__).parameters
    for name in ("connection_made", "connection_lost", "process_event", "recv"):
        assert callable(getattr(plain, name))
    assert "self.request = event" in inspect.getsource(plain.process_event)
    assert "self.protocol.send_response(self.response)" in inspect.getsource(plain.handshake)
    assert "self.eof_sent = True" in inspect.getsource(websockets.protocol.Protocol)


def test_no_light_tints_the_scan(server):
    buffered = server._websock_server._broadcast_buffer.message_from_id.values()
    lights = [m for m in buffered if isinstance(m, _messages.EnableLightsMessage)]
    assert lights
    assert not lights[-1].enabled


def test_the_patch_of_websockets_does_not_outlive_the_construction(server):
    assert inspect.isclass(websockets.asyncio.server.serve)


@pytest.mark.parametrize("encoding", ["gzip", "identity"])
def test_the_page_carries_its_title_and_the_scripts_of_static(server, encoding):
    status, headers, body = get(server, Accept_Encoding=encoding)
    page = (gzip.decompress(body) if encoding == "gzip" else body).decode()
    assert status == 200
    assert headers["Content-Length"] == str(len(body))
    assert "<title>GazeLoc</title>" in page
    assert "window.__viserMutable" in page  # tests/e2e looks whether the viewer has it
    assert page.index("toneMapping = 0") < page.index("</head>")
