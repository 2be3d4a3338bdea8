"""The list of messages that a page may send, and the widgets' own values, without a server."""

import contextlib
import math
from types import SimpleNamespace

import msgspec
import pytest
import viser
from gazeloc_app.door import messages
from gazeloc_app.door.gui_values import is_offered
from gazeloc_app.door.limits import BURST, MESSAGES_PER_S, Pace
from gazeloc_app.door.messages import Allowed, FileTransferPart, FileTransferStartUpload, Refused, read_message
from gazeloc_app.door.paths import folder_inside, is_plain
from gazeloc_app.door.uploads import MAX_AT_ONCE, MAX_TOTAL_BYTES, MAX_UPLOAD_BYTES, PageUploads, Underway
from viser import _messages
from viser.infra._messages import wire_field_names
from visitor import CAMERA

from gazeloc_core.errors import InputError

RAY = {"ray_origin": [0.0, 0.0, 0.0], "ray_direction": [0.0, 0.0, 1.0]}
CLICK = {"type": "ScenePointerMessage", "event_type": "click", **RAY, "screen_pos": [[0.5, 0.5]], "modifier": None}
DRAG = {
    "type": "SceneNodeDragMessage",
    "phase": "start",
    "name": "/keypoints/k1",
    "instance_index": None,
    "start_position": [1.0, 2.0, 3.0],
    "start_screen_pos": [0.1, 0.2],
    "end_position": [1, 2, 3],
    "end_screen_pos": [0.1, 0.2],
    "button": "left",
    "modifier": "shift",
    "owner": "",
}
VALUE = {"type": "GuiUpdateMessage", "uuid": "u", "updates": {"value": 3}}
NAN, INFINITE = math.nan, math.inf


def encoded(message):
    return msgspec.msgpack.encode(message)


@pytest.mark.parametrize("message", [CAMERA, CLICK, DRAG, VALUE, {"type": "CommandTriggerMessage", "uuid": "u"}])
def test_what_a_page_honestly_sends_is_read(message):
    assert type(read_message(encoded(message))).__name__ == message["type"]
    assert _messages.Message.deserialize(encoded(message))


@pytest.mark.parametrize(
    "message",
    [
        CAMERA | {"position": [NAN, 0, 0]},
        CAMERA | {"position": [INFINITE, 0, 0]},
        CAMERA | {"position": [1e300, 0, 0]},
        CAMERA | {"position": [0, 0]},
        CAMERA | {"position": "abc"},
        CAMERA | {"wxyz": [0, 0, 0, 0]},
        CAMERA | {"wxyz": [NAN, 0, 0, 1]},
        CAMERA | {"fov": 0},
        CAMERA | {"fov": 4},
        CAMERA | {"fov": NAN},
        CAMERA | {"image_width": 0},
        CAMERA | {"image_width": -5},
        CAMERA | {"image_height": 10**12},
        CAMERA | {"up_direction": [0, 0, 0]},
        CAMERA | {"more": 1},
        {name: value for name, value in CAMERA.items() if name != "look_at"},
        CLICK | {"ray_direction": [0.0, 0.0, 0.0]},
        CLICK | {"ray_direction": [NAN, NAN, NAN]},
        CLICK | {"ray_origin": None},
        CLICK | {"ray_origin": [0, -INFINITE, 0]},
        CLICK | {"event_type": "explode"},
        CLICK | {"screen_pos": [[0.5, 0.5]] * 1000},
        CLICK | {"screen_pos": []},
        CLICK | {"modifier": "hyper"},
        DRAG | {"end_position": [NAN, 0, 0]},
        DRAG | {"phase": "never"},
        DRAG | {"instance_index": -1},
        DRAG | {"name": "x" * 5000},
        VALUE | {"updates": {"value": 3, "disabled": False}},
        VALUE | {"updates": {"update_cb": []}},
        VALUE | {"updates": {"removed": True}},
        VALUE | {"updates": {"__class__": 1}},
        VALUE | {"updates": {}},
        VALUE | {"updates": [1]},
        VALUE | {"uuid": "x" * 1000},
        VALUE | {"uuid": ""},
        VALUE | {"updates": {"value": "x" * 100_000}},
        {"type": "ShareUrlRequest"},
        {"type": "ShareUrlDisconnect"},
        {"type": "RunJavascriptMessage", "source": "alert(1)"},
        {"type": "GuiFormDirtyMessage", "uuid": "u"},
        {"type": "GetRenderResponseMessage", "payload": b"", "render_uuid": "u"},
        {"type": "NoSuchMessage"},
        {"type": 5},
        {},
        [],
        5,
        None,
    ],
    ids=lambda message: str(message)[:60],
)
def test_what_is_made_up_is_refused(message):
    with pytest.raises(Refused):
        read_message(encoded(message))


@pytest.mark.parametrize(
    "raw",
    [
        *(b"", b"\xc1", b"\xff" * 100, b"\x91" * 50_000, b"\x91" * 100_000, b"\x81\xa4type" + b"\x91" * 2000),
        *(encoded(CAMERA)[:-3], encoded(CAMERA) + b"\x00", b"\x82\xa4type\xb3FileTransferPart"),
        *(b"\xdf\xff\xff\xff\xff", b"\xd9\x05\xff\xfe\xfd"),
    ],
    ids=lambda raw: f"{len(raw)} bytes",
)
def test_garbage_is_refused_and_nothing_worse(raw):
    with pytest.raises(Refused):
        read_message(raw)


def listed():
    return {kind.__name__: kind for kind in Allowed.__args__}


@pytest.mark.parametrize("name", listed())
def test_our_fields_are_those_of_viser(name):
    ours = {field.name for field in msgspec.structs.fields(listed()[name])}
    assert ours == set(wire_field_names(getattr(_messages, name))) - {"excluded_self_client"}


def test_nothing_that_viser_listens_to_is_forgotten():
    """A new version with a new message must be decided upon: on the list, or refused as these are."""
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        heard = {kind.__name__ for kind in server._websock_server._incoming_handlers}
    finally:
        server.stop()
    refused = {"ShareUrlRequest", "ShareUrlDisconnect", "GuiFormSubmitMessage", "GuiFormDirtyMessage"}
    per_client = {"ViewerCameraMessage", "LocalStorageGetItemResponseMessage"}
    assert heard - refused == set(listed()) - per_client


# Uploads.


def start(transfer="t", size=10, parts=2, button="b"):
    return FileTransferStartUpload(button, transfer, "keypoints.json", "application/json", parts, size)


def part(index, content=b"12345", transfer="t", button="b"):
    return FileTransferPart(button, transfer, index, content)


def test_an_upload_is_taken_note_of_until_its_last_part():
    underway = Underway()
    page = PageUploads(underway)
    page.begin(start())
    assert underway.total_bytes == 10
    page.add(part(1))
    page.add(part(0))
    assert underway.total_bytes == 0
    page.begin(start())  # its id is free again


@pytest.mark.parametrize(
    "message",
    [
        part(0, transfer="another page's"),
        part(0, button="another widget"),
        part(2),
        part(0, b"x" * 11),
        start(transfer="other"),
        start(),
        start(transfer="n", size=MAX_UPLOAD_BYTES + 1),
        start(transfer="n", size=1, parts=2),
        start(transfer="n", size=1, parts=0),
    ],
    ids=lambda message: repr(message)[:70],
)
def test_parts_and_uploads_that_were_not_announced_so_are_refused(message):
    underway = Underway()
    other, page = PageUploads(underway), PageUploads(underway)
    other.begin(start("another page's"))
    other.begin(start("other"))
    page.begin(start())
    with pytest.raises(Refused):
        page.begin(message) if isinstance(message, FileTransferStartUpload) else page.add(message)


def test_a_part_comes_once():
    page = PageUploads(Underway())
    page.begin(start())
    page.add(part(0))
    with pytest.raises(Refused):
        page.add(part(0))


def test_uploads_are_limited_per_page_and_in_all_and_freed_when_the_page_goes():
    underway = Underway()
    pages = [PageUploads(underway) for _ in range(4)]
    for number in range(MAX_AT_ONCE):
        pages[0].begin(start(f"a{number}"))
    with pytest.raises(Refused, match="too many"):
        pages[0].begin(start("one more"))
    begun = 0
    with contextlib.suppress(Refused):
        for number in range(12):
            pages[1 + number % 3].begin(start(f"b{number}", size=MAX_UPLOAD_BYTES))
            begun += MAX_UPLOAD_BYTES
    assert 0 < begun <= MAX_TOTAL_BYTES <= begun + MAX_UPLOAD_BYTES
    for page in pages:
        page.close()
    assert underway.total_bytes == 0


@pytest.mark.parametrize("name", ["../x", "a/b", "a\\b", "a\0b", "a\nb", "", "x" * 256])
def test_an_uploads_name_is_no_path(name):
    message = {"type": "FileTransferStartUpload", "source_component_uuid": "b", "transfer_uuid": "t"}
    message |= {"filename": name, "mime_type": "", "part_count": 1, "size_bytes": 1}
    with pytest.raises(Refused):
        read_message(encoded(message))


def test_a_flood_is_slowed_down_to_a_pace():
    now = [0.0]
    pace = Pace(lambda: now[0])
    delays = [pace.delay_s() for _ in range(BURST + 100)]
    assert delays[BURST - 1] == 0
    assert delays[-1] == pytest.approx(100 / MESSAGES_PER_S)
    now[0] += 1000
    assert pace.delay_s() == 0


# Values of widgets.


def widget(value, **properties):
    return SimpleNamespace(value=value, **properties)


@pytest.mark.parametrize(
    ("handle", "value"),
    [
        (widget("a", options=("a", "b")), "c"),
        (widget("a", options=("a", "b")), 0),
        (widget(3, min=0, max=10), 11),
        (widget(3, min=0, max=10), NAN),
        (widget(3, min=0, max=10), True),
        (widget(3.0, min=None, max=None), INFINITE),
        (widget(True), 1),
        (widget("text"), "x" * 5000),
        (widget("text"), b"text"),
        (widget((1.0, 2.0), min=0.0, max=3.0), [1.0, 4.0]),
        (widget((1.0, 2.0), min=(0.0, 0.0), max=(3.0, 1.0)), [1.0, 1.5]),
        (widget((1.0, 2.0)), [1.0]),
        (widget((1.0, 2.0)), {"0": 1, "1": 2}),
        (widget(3, disabled=True), 4),
        (widget(False, visible=False), True),
        (widget(None), 1),
        (widget(SimpleNamespace()), "an upload button has no value to set"),
    ],
)
def test_a_value_that_hands_cannot_set_is_not_offered(handle, value):
    assert not is_offered(handle, value)


@pytest.mark.parametrize(
    ("handle", "value"),
    [
        (widget("a", options=("a", "b")), "b"),
        (widget(3, min=0, max=10), 10),
        (widget(False), True),
        (widget("text", visible=True, disabled=False), "<script>"),
        (widget((1.0, 2.0), min=0.0, max=3.0), (0, 3)),
    ],
)
def test_a_value_that_hands_can_set_is(handle, value):
    assert is_offered(handle, value)


# Paths.


@pytest.mark.parametrize(
    "target",
    [
        *(
            "http://evil.example/",
            "//evil.example/",
            "*",
            "",
            "/../x",
            "/a/../../x",
            "/%2e%2e/x",
            "/%2E%2e%2fx",
            "/a%00b",
        ),
        *(
            "/%252e%252e/x",
            "/a\\..\\x",
            "/%5c..%5cx",
            "/a\x00",
            "/a b",
            "/é",
            "/./x",
            "/" + "x" * 5000,
            "/static/..%2fx",
        ),
    ],
)
def test_a_path_that_can_be_misread_is_refused(target):
    assert not is_plain(target)


@pytest.mark.parametrize("target", ["/", "/?token=a..b", "/frames/the%20walk/1.jpg?rev=a%2Fb", "/assets/a-1.2.js"])
def test_a_plain_path_is_plain(target):
    assert is_plain(target)


@pytest.mark.parametrize(
    "name",
    [
        "..",
        "../x",
        "a/../../x",
        "/etc",
        "~",
        "~/x",
        "C:\\x",
        "a\\b",
        "a\x00b",
        "a\nb",
        ".hidden/..",
        "x" * 100,
        "a//b",
        " /x",
        "link",
        "link/x",
        "a/.",
        "a/...",
        "<b>",
        "$(x)",
        "a/b/c/d/e/f/g/h/i",
    ],
)
def test_a_browser_names_no_folder_outside_of_the_one_for_exports(tmp_path, name):
    (tmp_path / "export").mkdir()
    (tmp_path / "export" / "link").symlink_to(tmp_path)
    with pytest.raises(InputError):
        folder_inside(tmp_path / "export", name)


@pytest.mark.parametrize("name", ["", "first try", "run_2/for Maria (new)", "später", "v1.0"])
def test_a_plain_name_is_a_folder_inside(tmp_path, name):
    assert folder_inside(tmp_path, name) == (tmp_path / name if name else tmp_path)


def test_limits_of_messages_leave_room_for_a_part_of_an_upload():
    assert messages.MAX_PART_BYTES < 4 * 1024 * 1024
