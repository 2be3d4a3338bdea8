"""Keypoints that came from a file."""

from __future__ import annotations

from dataclasses import dataclass

from gazeloc_app.state import AppState, Level
from gazeloc_core.clicks.keypoint_files import merged
from gazeloc_core.keypoints import KeypointSet


@dataclass(frozen=True)
class ImportKeypoints:
    """Keypoints were read from a file named `source`; `remark` is a sentence on them, or nothing."""

    read: KeypointSet
    source: str
    remark: str = ""

    def apply(self, state: AppState) -> AppState:
        """The state with them among the others (see `merged`), one step to undo."""
        before = state.annotation.keypoints
        after = merged(before, self.read)
        added = len(after) - len(before)
        text = f"{self.source}: {len(self.read)} keypoints, {added} of them new.{self.remark}"
        return state.with_keypoints(after).noticed(Level.INFO, text)
