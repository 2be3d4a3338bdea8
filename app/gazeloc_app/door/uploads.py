"""How much pages may upload: viser keeps every part in memory until the last has come, and trusts what they say.

A part that names another upload button than its upload began with would be set as that widget's value; one that names
another page's upload would be mixed into it. So each page has its own list of uploads that it began.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from gazeloc_app.door.messages import FileTransferPart, FileTransferStartUpload, Refused

MAX_UPLOAD_BYTES = 32 * 1024 * 1024
"""Of one file: keypoints and annotations are far smaller; scans and recordings are never uploaded."""
MAX_TOTAL_BYTES = 96 * 1024 * 1024
"""Of all uploads of all pages that are under way, as announced."""
MAX_AT_ONCE = 4
"""Uploads of one page that are under way."""


@dataclass
class Underway:
    """Uploads of all pages that are not complete, by their id: the bytes that they announced."""

    announced: dict[str, int] = field(default_factory=dict)

    @property
    def total_bytes(self) -> int:
        """What all of them may still come to."""
        return sum(self.announced.values())


@dataclass
class _Upload:
    button: str
    parts: int
    left_bytes: int
    seen: set[int] = field(default_factory=set)


class PageUploads:
    """The uploads of one page; `close()` when it goes."""

    def __init__(self, underway: Underway):
        self._underway = underway
        self._own: dict[str, _Upload] = {}

    def begin(self, message: FileTransferStartUpload) -> None:
        """Take note of a new upload.

        Raises:
            Refused: if it is too large, one too many, or has the id of another.
        """
        size = message.size_bytes
        if size > MAX_UPLOAD_BYTES:
            raise Refused(f"an upload of {size} bytes, the largest are {MAX_UPLOAD_BYTES}")
        if message.part_count > size or (message.part_count == 0) != (size == 0):
            raise Refused(f"an upload of {size} bytes in {message.part_count} parts")
        if message.transfer_uuid in self._underway.announced:
            raise Refused("an upload that is under way already")
        if len(self._own) >= MAX_AT_ONCE or self._underway.total_bytes + size > MAX_TOTAL_BYTES:
            raise Refused("too many uploads at once")
        if message.part_count:
            self._own[message.transfer_uuid] = _Upload(message.source_component_uuid, message.part_count, size)
            self._underway.announced[message.transfer_uuid] = size

    def add(self, message: FileTransferPart) -> None:
        """Take note of a part.

        Raises:
            Refused: if it is of no upload of this page, of another button, there already, or more than announced.
        """
        upload = self._own.get(message.transfer_uuid)
        if upload is None or message.source_component_uuid != upload.button:
            raise Refused("a part of no upload that this page began")
        if message.part_index >= upload.parts or message.part_index in upload.seen:
            raise Refused(f"part {message.part_index} of {upload.parts}")
        if len(message.content) > upload.left_bytes:
            raise Refused("more bytes than were announced")
        upload.seen.add(message.part_index)
        upload.left_bytes -= len(message.content)
        if len(upload.seen) == upload.parts:
            self._end(message.transfer_uuid)

    def close(self) -> None:
        """Forget what was not completed; viser drops its parts too."""
        for transfer in list(self._own):
            self._end(transfer)

    def _end(self, transfer: str) -> None:
        del self._own[transfer]
        self._underway.announced.pop(transfer, None)
