"""The player: while the state says that it plays, it moves the frame on by the recording's own times.

It looks at the clock and not at a counter: what took too long to apply or to draw is left out, never made up for.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import numpy as np

from gazeloc_app.actions.action import Action
from gazeloc_app.actions.playing import Play, PlayOn
from gazeloc_app.data import ProjectData
from gazeloc_app.state import AppState

TICK_S = 0.1
"""Ten frames a second are asked for; pages show as many of them as they can."""


class Player:
    """Plays on a thread of its own, which sleeps while nothing plays."""

    def __init__(self, data: ProjectData, state: Callable[[], AppState], dispatch: Callable[[Action], None]):
        self._data, self._state, self._dispatch = data, state, dispatch
        self._changed = threading.Event()
        self._ends = threading.Event()
        self._sent: tuple[str, int] | None = None
        self._position_ns = 0.0
        self._thread = threading.Thread(target=self._run, name="gazeloc-player", daemon=True)

    def start(self) -> None:
        """Begin to wait for the state to play."""
        self._thread.start()

    def stop(self) -> None:
        """End the thread."""
        self._ends.set()
        self._changed.set()
        if self._thread.is_alive():
            self._thread.join()

    def notice(self, before: AppState, after: AppState) -> None:
        """An effect of the store: wake up when playing begins."""
        if after.is_playing and not before.is_playing:
            self._sent = None
            self._changed.set()

    def advance(self, elapsed_s: float) -> None:
        """Ask for the frame that is due after a piece of real time, from where the state is."""
        state = self._state()
        times = self._data.recording(state.recording).timestamp_ns
        frame = min(state.frame, len(times) - 1)
        if self._sent != (state.recording, frame):  # the first step, or somebody moved on by hand
            self._position_ns = float(times[frame])
        self._position_ns += elapsed_s * state.speed * 1e9
        due = int(np.searchsorted(times, self._position_ns, side="right")) - 1
        if frame == len(times) - 1:
            self._dispatch(Play(False))
        elif due != frame:
            self._dispatch(PlayOn(state.recording, due))
        self._sent = (state.recording, due)

    def _run(self) -> None:
        while True:
            self._changed.wait()
            self._changed.clear()
            last = time.monotonic()
            while self._state().is_playing and not self._ends.wait(TICK_S):
                now = time.monotonic()
                self.advance(now - last)
                last = now
            if self._ends.is_set():
                return
