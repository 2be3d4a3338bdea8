"""Work for a view that takes too long for the loop of the store: on a thread of its own, for the newest wish alone."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from typing import Generic, TypeVar

log = logging.getLogger(__name__)
_Wish = TypeVar("_Wish")


class Newest(Generic[_Wish]):
    """`work(wish)` for the newest wish; older ones that were not begun yet are dropped. The thread goes when idle."""

    def __init__(self, work: Callable[[_Wish], None], name: str):
        self._work, self._name = work, name
        self._change = threading.Condition()
        self._wishes: list[_Wish] = []
        self._is_working = False

    def ask(self, wish: _Wish) -> None:
        """Ask for the work; returns at once."""
        with self._change:
            self._wishes = [wish]
            if not self._is_working:
                self._is_working = True
                threading.Thread(target=self._run, name=self._name, daemon=True).start()

    def is_newest(self, wish: _Wish) -> bool:
        """Whether nothing newer was asked for since."""
        with self._change:
            return not self._wishes or self._wishes == [wish]

    def wait(self, seconds: float = 30.0) -> bool:
        """Wait until nothing is left to do; False where that takes longer."""
        with self._change:
            return self._change.wait_for(lambda: not self._is_working, seconds)

    def _run(self) -> None:
        while True:
            with self._change:
                if not self._wishes:
                    self._is_working = False
                    self._change.notify_all()
                    return
                wish = self._wishes.pop()
            try:
                self._work(wish)
            except Exception:  # the next wish must be answered, whatever a bug of ours does to this one
                log.exception("%s", self._name)
