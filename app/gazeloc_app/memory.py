"""Values by name, made again only where what they depend on has changed."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeVar

T = TypeVar("T")


@dataclass
class _Entry:
    lock: threading.RLock = field(default_factory=threading.RLock)
    content: object = None
    value: Any = None
    is_made: bool = False


class Memory:
    """Safe to use from several threads: one value is made once, and nobody waits for another value to be made.

    What makes a value may ask for others, as long as none of them asks for it in turn.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._entries: dict[str, _Entry] = {}

    def of(self, name: str, content: object, make: Callable[[], T]) -> T:
        """The value of this name; `make()` makes it where there is none yet, or was of other `content`."""
        with self._lock:
            entry = self._entries.setdefault(name, _Entry())
        with entry.lock:
            if not entry.is_made or entry.content != content:
                entry.value = make()
                entry.content, entry.is_made = content, True
            value: T = entry.value
            return value
