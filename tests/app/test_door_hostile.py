"""A hostile visitor against the running server, over a real socket: refused each time, and the others notice nothing.

Every test ends with the honest page, connected throughout, moving its slider and the server taking it.
"""

import asyncio
import contextlib
import socket
import time

import pytest
from gazeloc_app.door import limits
from gazeloc_app.door.limits import MAX_MESSAGE_BYTES, MAX_REFUSED
from gazeloc_app.door.uploads import MAX_UPLOAD_BYTES
from gazeloc_app.routes import Routes, add_static_route
from gazeloc_app.server import make_server
from viser import _messages
from visitor import CAMERA, get, page, raw, until
from websockets.exceptions import InvalidStatus


class Room:
    """A server with a widget of every kind, and what happened to them."""

    def __init__(self):
        routes = Routes()
        add_static_route(routes)
        self.server = make_server(0, routes)
        self.port = self.server.get_port()
        gui = self.server.gui
        self.slider = gui.add_slider("slider", 0, 10, 1, 3)
        self.dropdown = gui.add_dropdown("dropdown", ("a", "b"))
        self.text = gui.add_text("text", "x")
        self.button = gui.add_button("button")
        self.hidden = gui.add_button("hidden", visible=False)
        self.disabled = gui.add_checkbox("disabled", False, disabled=True)
        self.upload = gui.add_upload_button("upload")
        self.events, self.clicks, self.cameras = [], [], []
        for handle in (self.slider, self.dropdown, self.text, self.disabled):
            self._note(handle.on_update)
        for handle in (self.button, self.hidden):
            self._note(handle.on_click)
        self._note(self.upload.on_upload)

        @self.server.scene.on_click()
        async def _(event):
            self.clicks.append(event)

        @self.server.on_client_connect
        async def _(client):
            client.camera.on_update(lambda camera: self.cameras.append(camera.position))

    def _note(self, listen):
        async def happened(event):
            self.events.append(event.target)

        listen(happened)

    def state(self):
        """Everything that a visitor must not change."""
        handles = (self.slider, self.dropdown, self.text, self.button, self.hidden, self.disabled, self.upload)
        values = tuple(repr(handle.value) for handle in handles[:-1])
        fields = tuple((h._impl.removed, len(h._impl.update_cb), h.visible, h.disabled) for h in handles)
        return values, fields, len(self.events), len(self.clicks)


@pytest.fixture(scope="module")
def shared_room():
    room = Room()
    yield room
    room.server.stop()


@pytest.fixture
def room(shared_room):
    shared_room.events.clear()
    shared_room.clicks.clear()
    return shared_room


def update(handle, **updates):
    return {"type": "GuiUpdateMessage", "uuid": handle._impl.uuid, "updates": updates}


def begin(handle, size, parts=1, transfer="t"):
    message = {"type": "FileTransferStartUpload", "source_component_uuid": handle._impl.uuid, "transfer_uuid": transfer}
    return message | {"filename": "f.json", "mime_type": "", "part_count": parts, "size_bytes": size}


def part(handle, content, index=0, transfer="t"):
    message = {"type": "FileTransferPart", "source_component_uuid": handle._impl.uuid, "transfer_uuid": transfer}
    return message | {"part_index": index, "content": content}


def attack(room, strike, *, changes=False):
    """Let a visitor strike beside an honest page, whose next change must be taken."""

    async def both():
        async with page(room.port) as honest, page(room.port) as hostile:
            for one in (honest, hostile):
                await one.send(CAMERA)
            before = room.state()
            result = await strike(hostile)
            await asyncio.sleep(0.15)
            assert changes or room.state() == before
            value = 4 if room.slider.value != 4 else 5
            await honest.send(update(room.slider, value=value))
            assert await until(lambda: room.slider.value == value)
            assert honest.connection.close_code is None
            return result

    return asyncio.run(both())


def dropped(room, *messages):
    """The messages change nothing, and their sender stays."""

    async def strike(hostile):
        for message in messages:
            await hostile.send(message)

    attack(room, strike)


@pytest.mark.parametrize("value", [10**9, -1, float("nan"), float("inf"), "5", None, [1], {"a": 1}, True, 2**63])
def test_out_of_range_values(room, value):
    dropped(room, update(room.slider, value=value))


@pytest.mark.parametrize("value", ["../../etc/passwd", "", 0, None, ["a"]])
def test_dropdown_values_that_were_not_offered(room, value):
    dropped(room, update(room.dropdown, value=value))


@pytest.mark.parametrize("field", ["removed", "update_cb", "sync_cb", "uuid", "visible", "__class__", "props"])
def test_overwritten_fields_of_a_handle(room, field):
    for value in (True, [], None):
        dropped(room, update(room.slider, **{field: value}))
        dropped(room, update(room.slider, value=7, **{field: value}))


def test_widgets_that_are_hidden_or_disabled(room):
    dropped(room, update(room.hidden, value=True), update(room.disabled, value=True))


def test_text_that_is_too_long(room):
    dropped(room, update(room.text, value="x" * 5000), update(room.text, value="x" * 1_000_000))


@pytest.mark.parametrize("numbers", [[float("nan")] * 3, [float("inf"), 0, 0], [0, 0, 0]])
def test_clicks_along_no_ray(room, numbers):
    click = {"type": "ScenePointerMessage", "event_type": "click", "screen_pos": [[0.5, 0.5]], "modifier": None}
    dropped(room, click | {"ray_origin": [0, 0, 0], "ray_direction": numbers})


def test_cameras_that_are_nowhere(room):
    async def strike(hostile):
        await until(lambda: len(room.cameras) >= 0)
        before = len(room.cameras)
        for wrong in ({"position": [float("nan")] * 3}, {"wxyz": [0, 0, 0, 0]}, {"fov": -1.0}, {"image_height": 0}):
            await hostile.send(CAMERA | wrong)
        await asyncio.sleep(0.1)
        assert all(abs(number) < 1e9 for position in room.cameras[before:] for number in position)

    attack(room, strike)


@pytest.mark.parametrize("name", ["ShareUrlRequest", "ShareUrlDisconnect"])
def test_a_public_tunnel(room, name):
    assert getattr(_messages, name) not in room.server._websock_server._incoming_handlers
    dropped(room, {"type": name})
    assert room.server._share_tunnel is None


def test_messages_that_are_meant_for_browsers(room):
    dropped(
        room,
        {"type": "RunJavascriptMessage", "source": "alert(1)"},
        {"type": "GuiRemoveMessage", "uuid": room.slider._impl.uuid},
        {"type": "GuiFormDirtyMessage", "uuid": "x"},
        {"type": "NoSuchMessage"},
    )


@pytest.mark.parametrize("message", [b"", b"\xc1garbage", b"\x91" * 60_000, b"\x91" * 3_000_000, b"\x05"])
def test_garbage(room, message):
    dropped(room, message)


def test_text_frames(room):
    dropped(room, "hello", '{"type": "GuiUpdateMessage"}')


def test_a_page_that_keeps_on_sending_nonsense_is_sent_away(room):
    async def strike(hostile):
        for _ in range(MAX_REFUSED + 5):
            await hostile.send(b"nonsense")
        return await hostile.close_code()

    assert attack(room, strike) == 1008


def test_a_giant_message_ends_its_own_connection(room):
    async def strike(hostile):
        await hostile.send(b"x" * (MAX_MESSAGE_BYTES + 1))
        return await hostile.close_code()

    assert attack(room, strike) == 1009


def test_a_flood_of_messages_is_read_at_a_pace(room, monkeypatch):
    monkeypatch.setattr(limits, "MESSAGES_PER_S", 50.0)
    taken = []

    async def strike(hostile):
        flood = [{"type": "CommandTriggerMessage", "uuid": f"nobody {number}"} for number in range(3000)]
        sender = asyncio.create_task(send_all(hostile, flood))
        begun = time.monotonic()
        await asyncio.to_thread(get, room.port)
        taken.append(time.monotonic() - begun)
        sender.cancel()

    async def send_all(hostile, messages):
        for message in messages:
            await hostile.send(message)

    attack(room, strike)
    assert taken[0] < 2.0


def test_an_upload_that_is_too_large(room):
    dropped(room, begin(room.upload, MAX_UPLOAD_BYTES + 1), part(room.upload, b"x" * 1000))
    assert not room.server.gui._current_file_upload_states


def test_more_bytes_than_an_upload_announced(room):
    async def strike(hostile):
        await hostile.send(begin(room.upload, 10, parts=2))
        for index in range(2):
            await hostile.send(part(room.upload, b"x" * 500_000, index))
        await until(lambda: room.server.gui._current_file_upload_states)
        (state,) = room.server.gui._current_file_upload_states.values()
        return state["transferred_bytes"]

    assert attack(room, strike) == 0
    assert until_empty(room)


def test_many_uploads_at_once(room):
    async def strike(hostile):
        for number in range(40):
            await hostile.send(begin(room.upload, MAX_UPLOAD_BYTES, parts=99, transfer=f"t{number}"))
        await asyncio.sleep(0.2)
        return sum(state["total_bytes"] for state in room.server.gui._current_file_upload_states.values())

    assert attack(room, strike) <= 4 * MAX_UPLOAD_BYTES
    assert until_empty(room)


def until_empty(room):
    """Whether nothing of an upload is kept once its page has gone."""
    return asyncio.run(until(lambda: not room.server.gui._current_file_upload_states))


@pytest.mark.parametrize("name", ["slider", "text", "button", "dropdown"])
def test_an_upload_into_another_widget(room, name):
    target = getattr(room, name)
    dropped(room, begin(target, 4), part(target, b"evil"))

    async def strike(hostile):
        await hostile.send(begin(room.upload, 4))
        await hostile.send(part(target, b"evil"))

    attack(room, strike)


def test_parts_for_the_upload_of_another_page(room):
    async def strike(hostile):
        async with page(room.port) as third:
            await third.send(CAMERA)
            await third.send(begin(room.upload, 8, parts=2, transfer="theirs"))
            await third.send(part(room.upload, b"good", 0, "theirs"))
            await until(lambda: "theirs" in room.server.gui._current_file_upload_states)
            await hostile.send(begin(room.upload, 8, parts=2, transfer="theirs"))
            await hostile.send(part(room.upload, b"evil", 1, "theirs"))
            await asyncio.sleep(0.2)
            await third.send(part(room.upload, b"file", 1, "theirs"))
            await until(lambda: room.events)

    attack(room, strike, changes=True)
    assert room.events[0] is room.upload
    assert room.upload.value.content == b"goodfile"


def test_an_honest_upload_arrives(room):
    async def strike(hostile):
        await hostile.send(begin(room.upload, 600_000, parts=2))
        await hostile.send(part(room.upload, b"a" * 524_288, 0))
        await hostile.send(part(room.upload, b"b" * 75_712, 1))
        await until(lambda: room.events)

    attack(room, strike, changes=True)
    assert room.upload.value.content == b"a" * 524_288 + b"b" * 75_712


@pytest.mark.parametrize(
    "path",
    [
        *("/../../etc/passwd", "/%2e%2e/%2e%2e/etc/passwd", "/..%2f..%2fetc/passwd", "/%252e%252e/etc/passwd"),
        *("/..\\..\\etc\\passwd", "/%5c..%5c..%5cetc/passwd", "/static/..%2fpyproject.toml", "/static/%2fetc%2fpasswd"),
        *(
            "/static//etc/passwd",
            "//etc/passwd",
            "/etc/passwd%00.js",
            "/static/x%00",
            "/static/C:%5cx",
            "file:///etc/passwd",
        ),
        *("http://evil.example/", "*", "/~/", "/." + "/x" * 50),
    ],
)
def test_path_tricks(room, path):
    answered = raw(room.port, f"GET {path} HTTP/1.1\r\nHost: localhost:{room.port}\r\n\r\n".encode())
    assert answered.split(b"\r\n")[0] in (
        b"HTTP/1.1 404 Not Found",
        b"HTTP/1.1 404 NOT FOUND",
        b"HTTP/1.1 400 Bad Request",
    )
    assert b"root:" not in answered
    assert b"[project]" not in answered


@pytest.mark.parametrize(
    "sent",
    [
        b"POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5\r\n\r\nhello",
        b"CONNECT evil.example:443 HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: localhost\r\nHost: evil.example\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: evil.example\r\nX-Forwarded-Host: localhost\r\n\r\n",
        b"GET / HTTP/1.1\r\n\r\n",
        b"GET / HTTP/1.0\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: localhost\r\n" + b"X: y\r\n" * 500 + b"\r\n",
        b"GET /" + b"x" * 20_000 + b" HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03\r\n\r\n",
        b"\x00" * 3000,
    ],
    ids=lambda sent: repr(sent[:40]),
)
def test_requests_that_no_browser_sends(room, sent):
    answered = raw(room.port, sent, seconds=2)
    assert not answered.startswith(b"HTTP/1.1 200")
    assert get(room.port)[0] == 200


def test_a_visitor_that_says_nothing_is_sent_away(room, monkeypatch):
    monkeypatch.setattr(limits, "REQUEST_TIMEOUT_S", 0.5)
    with socket.create_connection(("127.0.0.1", room.port), timeout=5) as slow:
        begun = time.monotonic()
        for letter in b"GET / HTTP/1.1":
            slow.send(bytes([letter]))
            if time.monotonic() - begun > 0.4:
                break
            time.sleep(0.05)
        with contextlib.suppress(ConnectionError):
            assert slow.recv(10) == b""
        assert time.monotonic() - begun < 3


def test_a_crowd_that_says_nothing_keeps_nobody_out(room):
    crowd = []
    try:
        for _ in range(2 * limits.MAX_WAITING):
            crowd.append(socket.create_connection(("127.0.0.1", room.port), timeout=5))
            crowd[-1].send(b"GET / HT")
        begun = time.monotonic()
        assert get(room.port)[0] == 200
        assert time.monotonic() - begun < 2
        dropped(room)
    finally:
        for one in crowd:
            one.close()


def test_too_many_pages(room, monkeypatch):
    monkeypatch.setattr(limits, "MAX_PAGES", 3)

    async def strike(hostile):
        async with page(room.port):
            with pytest.raises(InvalidStatus) as no:
                async with page(room.port):
                    pass
            return no.value.response.status_code

    assert attack(room, strike) == 503
    time.sleep(0.5)
    assert attack(room, strike) == 503  # who left has made room for the next two


def test_too_many_connections(room, monkeypatch):
    monkeypatch.setattr(limits, "MAX_CONNECTIONS", 5)

    async def strike(hostile):
        crowd = [await asyncio.open_connection("127.0.0.1", room.port) for _ in range(8)]
        ends = [await asyncio.wait_for(reader.read(), 2) for reader, _ in crowd[4:]]
        for _, writer in crowd:
            writer.close()
        await asyncio.sleep(0.2)
        return ends

    assert attack(room, strike) == [b""] * 4
    assert get(room.port)[0] == 200
