"""The one loop: takes actions from a queue, applies them to the frozen state, saves, and then lets every view render.

viser runs callbacks on many threads at once and in no order (50 clicks of `n += 1` were measured to give 2 to 5), so
no callback touches the state: it calls `dispatch`. The loop runs on a thread of its own, or in tests by `step()`.
"""

from __future__ import annotations

import logging
import queue
import threading
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext

from gazeloc_app.actions.action import Action
from gazeloc_app.state import AppState, Level
from gazeloc_core.errors import GazelocError

log = logging.getLogger(__name__)

View = Callable[[AppState], None]
Effect = Callable[[AppState, AppState], None]


class Store:
    """Holds the state.

    Actions that wait are applied as one batch, in order; then savers put it on the disk, so that nothing is shown that
    a crash could take back; then every view renders; then effects run (they start jobs).
    """

    def __init__(
        self,
        state: AppState,
        batch: Callable[[], AbstractContextManager[object]] = nullcontext,
        save_again_s: float = 3.0,
    ):
        """`batch` wraps the rendering of all views, so that a browser sees it as one change.

        What could not be saved is tried again every `save_again_s`, and once more at the end.
        """
        self._state, self._save_again_s = state, save_again_s
        self._is_unsaved = False
        self._batch = batch
        self._queue: queue.SimpleQueue[Action | None] = queue.SimpleQueue()
        self._savers: list[Effect] = []
        self._effects: list[Effect] = []
        self._views: list[View] = []
        self._thread: threading.Thread | None = None
        self.applied = 0
        """How many actions were applied since the start."""

    @property
    def state(self) -> AppState:
        """The state now."""
        return self._state

    def begin(self, state: AppState) -> None:
        """Take another state to begin with, before the loop runs and before any view."""
        self._state = state

    def add_saver(self, saver: Effect) -> None:
        """Call `saver(before, after)` after every batch of actions, on the loop, before the views render.

        What it raises is shown with the state: the person then knows that it is not saved.
        """
        self._savers.append(saver)

    def add_effect(self, effect: Effect) -> None:
        """Call `effect(before, after)` after every batch of actions, on the loop, once the views have rendered."""
        self._effects.append(effect)

    def add_view(self, view: View) -> None:
        """Call `view(state)` once now and after every batch of actions, on the loop."""
        self._views.append(view)

    def dispatch(self, action: Action) -> None:
        """Enqueue an action; returns at once, from any thread."""
        self._queue.put(action)

    def start(self) -> None:
        """Render all views and run the loop on a thread of its own."""
        self._render()
        self._thread = threading.Thread(target=self._run, name="gazeloc-store", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the loop after what is enqueued."""
        self._queue.put(None)
        if self._thread is not None:
            self._thread.join()

    def step(self) -> int:
        """Apply all enqueued actions now, on this thread; how many there were. For tests without a loop."""
        actions = self._waiting()
        self._apply_all([action for action in actions if action is not None])
        return len(actions)

    def _run(self) -> None:
        while True:
            try:
                actions = [self._queue.get(timeout=self._save_again_s if self._is_unsaved else None), *self._waiting()]
            except queue.Empty:
                self.save_again()
                continue
            self._apply_all([action for action in actions if action is not None])
            if None in actions:
                self.save_again()
                return

    def save_again(self) -> None:
        """Where something could not be saved, try again; once it is, say so."""
        if not self._is_unsaved:
            return
        failing, self._is_unsaved = self._state, False
        self._save(failing, failing)
        self._run_effects(failing, failing)
        if self._is_unsaved:
            self._state = failing  # it says so already
        else:
            self._state = self._state.noticed(Level.INFO, "Your last changes are saved now.")
            self._render()

    def _waiting(self) -> list[Action | None]:
        actions: list[Action | None] = []
        while True:
            try:
                actions.append(self._queue.get_nowait())
            except queue.Empty:
                return actions

    def _apply_all(self, actions: list[Action]) -> None:
        if not actions:
            return
        before = self._state
        for action in actions:
            earlier = self._state
            self._apply(action)
            if self._state.recording != earlier.recording:  # what was decided about the one that is left is saved first
                self._save(before, earlier)
                self._run_effects(before, earlier)
                before = self._state
        self._save(before, self._state)
        self._render()
        shown = self._state
        self._run_effects(before, shown)
        if self._state is not shown:
            self._render()

    def _apply(self, action: Action) -> None:
        try:
            self._state = action.apply(self._state)
        except GazelocError as error:
            self._state = self._state.noticed(Level.ERROR, str(error))
        except Exception as error:  # the loop must live on, whatever a bug of ours does to one action
            log.exception("applying %r", action)
            self._state = self._state.noticed(Level.ERROR, f"A fault in GazeLoc stopped this action: {error}.")
        self.applied += 1

    def _save(self, before: AppState, after: AppState) -> None:
        self._run_all(self._savers, before, after, "This was not saved")

    def _run_effects(self, before: AppState, after: AppState) -> None:
        self._run_all(self._effects, before, after, "A fault in GazeLoc stopped what should have followed")

    def _run_all(self, effects: list[Effect], before: AppState, after: AppState, failed: str) -> None:
        for effect in effects:
            try:
                effect(before, after)
            except GazelocError as error:
                self._is_unsaved = True
                self._state = self._state.noticed(Level.ERROR, str(error))
            except Exception as error:
                log.exception("after an action")
                self._is_unsaved |= effects is self._savers
                self._state = self._state.noticed(Level.ERROR, f"{failed}: {error}.")

    def _render(self) -> None:
        with self._batch():
            for view in self._views:
                try:
                    view(self._state)
                except Exception:  # one broken view must not take the others along
                    log.exception("rendering")
