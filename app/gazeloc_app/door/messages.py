"""Which messages a page may send: a closed list, each with its fields, their types and their bounds.

viser turns whatever comes into a message of any of its types, the ones meant for the browser included, and hands NaN
and endless strings on. Here the bytes are read first, against types of our own; what does not fit never reaches viser.
Not on the list: requests for a public tunnel, forms (the app has none; their echo would stay in memory for ever) and
pictures of the page (never asked for).
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta, Struct

MAX_PLAIN_BYTES = 64 * 1024
"""Of any message but a part of an upload."""
MAX_PART_BYTES = 1024 * 1024
"""Of a part of an upload; viser's page cuts files into half megabytes."""

Id = Annotated[str, Meta(min_length=1, max_length=64)]
Name = Annotated[str, Meta(max_length=1024)]
Length = Annotated[float, Meta(ge=-1e9, le=1e9)]
Pixels = Annotated[float, Meta(ge=1, le=65536)]
Vector = tuple[Length, Length, Length]
Spot = tuple[Length, Length]
Quaternion = tuple[Length, Length, Length, Length]
Keys = Literal["cmd/ctrl", "alt", "shift", "cmd/ctrl+alt", "cmd/ctrl+shift", "alt+shift", "cmd/ctrl+alt+shift"]
Instance = Annotated[int, Meta(ge=0, le=2**31)]


class _Message(Struct, tag_field="type", forbid_unknown_fields=True):
    """A message by the name that is its tag."""


class ViewerCameraMessage(_Message, tag=True):  # noqa: D101
    wxyz: Quaternion
    position: Vector
    fov: Annotated[float, Meta(gt=0, lt=math.pi)]
    near: Length
    far: Length
    image_height: Pixels
    image_width: Pixels
    look_at: Vector
    up_direction: Vector

    def __post_init__(self) -> None:
        _check_rotation(self.wxyz)
        _check_direction(self.up_direction)


class ScenePointerMessage(_Message, tag=True):  # noqa: D101
    event_type: Literal["click", "rect-select"]
    ray_origin: Vector | None
    ray_direction: Vector | None
    screen_pos: Annotated[list[Spot], Meta(min_length=1, max_length=4)]
    modifier: Keys | None

    def __post_init__(self) -> None:
        if self.event_type == "click" and (self.ray_origin is None or self.ray_direction is None):
            raise ValueError("a click has a ray")
        if self.ray_direction is not None:
            _check_direction(self.ray_direction)


class SceneNodeClickMessage(_Message, tag=True):  # noqa: D101
    name: Name
    instance_index: Instance | None
    ray_origin: Vector
    ray_direction: Vector
    screen_pos: Spot
    modifier: Keys | None
    owner: Name = ""

    def __post_init__(self) -> None:
        _check_direction(self.ray_direction)


class SceneNodeDragMessage(_Message, tag=True):  # noqa: D101
    phase: Literal["start", "update", "end"]
    name: Name
    instance_index: Instance | None
    start_position: Vector
    start_screen_pos: Spot
    end_position: Vector
    end_screen_pos: Spot
    button: Literal["left", "middle", "right"]
    modifier: Keys | None
    owner: Name = ""


class TransformControlsUpdateMessage(_Message, tag=True):  # noqa: D101
    name: Name
    wxyz: Quaternion
    position: Vector
    owner: Name = ""

    def __post_init__(self) -> None:
        _check_rotation(self.wxyz)


class TransformControlsDragStartMessage(_Message, tag=True):  # noqa: D101
    name: Name
    owner: Name = ""


class TransformControlsDragEndMessage(_Message, tag=True):  # noqa: D101
    name: Name
    owner: Name = ""


class GuiUpdateMessage(_Message, tag=True):
    """`updates` is the value alone; whether the widget offers it is looked up later (gui_values.py)."""

    uuid: Id
    updates: Annotated[dict[Literal["value"], Any], Meta(min_length=1, max_length=1)]


class GuiButtonHoldMessage(_Message, tag=True):  # noqa: D101
    uuid: Id
    frequency: Annotated[float, Meta(gt=0, le=1000)]


class CommandTriggerMessage(_Message, tag=True):  # noqa: D101
    uuid: Id


class LocalStorageGetItemResponseMessage(_Message, tag=True):  # noqa: D101
    request_uuid: Id
    value: Annotated[str, Meta(max_length=16384)] | None
    error: Annotated[str, Meta(max_length=1024)] | None


class FileTransferStartUpload(_Message, tag=True):  # noqa: D101
    source_component_uuid: Id
    transfer_uuid: Id
    filename: Annotated[str, Meta(min_length=1, max_length=255, pattern=r"^[^/\\\x00-\x1f\x7f]+$")]
    mime_type: Annotated[str, Meta(max_length=255)]
    part_count: Annotated[int, Meta(ge=0, le=4096)]
    size_bytes: Annotated[int, Meta(ge=0, le=2**40)]


class FileTransferPart(_Message, tag=True):  # noqa: D101
    source_component_uuid: Id
    transfer_uuid: Id
    part_index: Annotated[int, Meta(ge=0, le=4096)]
    content: Annotated[bytes, Meta(max_length=MAX_PART_BYTES)]


Allowed = (
    ViewerCameraMessage
    | ScenePointerMessage
    | SceneNodeClickMessage
    | SceneNodeDragMessage
    | TransformControlsUpdateMessage
    | TransformControlsDragStartMessage
    | TransformControlsDragEndMessage
    | GuiUpdateMessage
    | GuiButtonHoldMessage
    | CommandTriggerMessage
    | LocalStorageGetItemResponseMessage
    | FileTransferStartUpload
    | FileTransferPart
)
_decoder: msgspec.msgpack.Decoder[Allowed] = msgspec.msgpack.Decoder(Allowed)
_head = msgspec.msgpack.Decoder(dict[str, msgspec.Raw])


class Refused(Exception):
    """A message that is not taken; says why."""


def read_message(raw: bytes) -> Allowed:
    """The message that a page sent.

    Raises:
        Refused: if it is none, not on the list, or out of bounds.
    """
    try:
        if len(raw) > MAX_PLAIN_BYTES and _type_of(raw) != "FileTransferPart":
            raise Refused(f"a message of {len(raw)} bytes, the largest are {MAX_PLAIN_BYTES}")
        return _decoder.decode(raw)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError, OverflowError) as error:
        raise Refused(str(error)[:200]) from None


def _type_of(raw: bytes) -> object:
    """The type that a message says it has, without reading the rest."""
    named = _head.decode(raw).get("type")
    return None if named is None else msgspec.msgpack.decode(named)


def _check_rotation(wxyz: tuple[float, ...]) -> None:
    if not 0.9 < math.hypot(*wxyz) < 1.1:
        raise ValueError("a rotation is a quaternion of length 1")


def _check_direction(direction: tuple[float, ...]) -> None:
    if not math.hypot(*direction) > 1e-9:
        raise ValueError("a direction is not zero")
