"""The alignment that follows the keypoints: fitted anew at every change of them, on a thread of its own.

It is the fit of the button Align (`alignment.align` to tags and keypoints, with its evidence and verdicts), kept as a
file named by its content like every alignment, and part of the undo step of the change that it answers. Where an
alignment of another kind is in force (ICP, or one that was chosen from the list), nothing follows until a person asks.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from typing import NamedTuple

from gazeloc_app.actions.action import Action
from gazeloc_app.actions.live import FitFound
from gazeloc_app.data import ProjectData
from gazeloc_app.state import AppState
from gazeloc_core.alignment.alignment import AlignmentMethod, align
from gazeloc_core.alignment.correspondences import gather
from gazeloc_core.errors import GazelocError
from gazeloc_core.keypoints import KeypointPair, KeypointSet
from gazeloc_core.stages.registration import align_options, save_alignment

log = logging.getLogger(__name__)


class _Wanted(NamedTuple):
    recording: str
    keypoints: KeypointSet
    is_step: bool


class LiveAlignment:
    """Answers changes of the keypoints; only the newest matters."""

    def __init__(self, data: ProjectData, dispatch: Callable[[Action], None]):
        self._data, self._dispatch = data, dispatch
        self._wanted: _Wanted | None = None
        self._change = threading.Condition()
        self._ended = False
        self._thread = threading.Thread(target=self._run, name="gazeloc-live", daemon=True)

    def start(self) -> None:
        """Fit on a thread of its own until `stop()`."""
        self._thread.start()

    def stop(self) -> None:
        """End the thread: when this returns, nothing is written to the project any more."""
        with self._change:
            self._ended = True
            self._change.notify()
        if self._thread.is_alive():
            self._thread.join()

    def follow(self, before: AppState, after: AppState) -> None:
        """An effect of the store: ask for a fit where the keypoints that count changed, or a person asked."""
        is_asked = before.live_asked != after.live_asked and before.recording == after.recording
        is_changed = before.recording == after.recording and _counting(before) != _counting(after)
        if is_asked or (is_changed and is_following(self._data, after)):
            with self._change:
                self._wanted = _Wanted(after.recording, after.annotation.keypoints, is_asked)
                self._change.notify()

    def fit_wanted(self) -> bool:
        """Fit what was asked for, now and here; False where nothing was."""
        with self._change:
            wanted, self._wanted = self._wanted, None
        if wanted is None:
            return False
        key, note = None, ""
        try:
            key = self._fit(wanted)
        except GazelocError as error:
            note = str(error)
        except OSError as error:
            note = f"The alignment could not be saved ({error.strerror}); free some space and change a keypoint."
        self._dispatch(FitFound(wanted.recording, wanted.keypoints, key, note, wanted.is_step))
        return True

    def _run(self) -> None:
        while True:
            with self._change:
                self._change.wait_for(lambda: self._ended or self._wanted is not None)
                if self._ended:
                    return
            try:
                self.fit_wanted()
            except Exception:  # the next change must be answered, whatever a bug of ours does to this one
                log.exception("fitting the keypoints")

    def _fit(self, wanted: _Wanted) -> str | None:
        model = self._data.model(wanted.recording)
        if model is None:
            return None
        pairs = gather(self._data.scan_tags(), self._data.sfm_tags(wanted.recording), wanted.keypoints)
        alignment = align(pairs, align_options(self._data.project), model=model)
        save_alignment(self._data.project, wanted.recording, alignment)
        return alignment.key


def is_following(data: ProjectData, state: AppState) -> bool:
    """Whether the alignment follows the keypoints: a person wants it, and what is in force is a fit to keypoints."""
    if not state.annotation.is_live or state.annotation.alignment is None:
        return state.annotation.is_live
    alignment = data.alignment(state.recording, state.annotation.alignment)
    return alignment is not None and alignment.method is AlignmentMethod.KEYPOINTS


def _counting(state: AppState) -> tuple[KeypointPair, ...]:
    return tuple(pair for pair in state.annotation.keypoints if pair.counts)
