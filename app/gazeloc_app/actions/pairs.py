"""What can be done to the keypoint pairs that are there."""

from __future__ import annotations

from dataclasses import dataclass, replace

from gazeloc_app.state import AppState, Level


@dataclass(frozen=True)
class SelectPair:
    """A pair was selected, or none: the next click then starts a new one."""

    key: str | None

    def apply(self, state: AppState) -> AppState:
        """The state with the selection."""
        known = self.key is None or state.annotation.keypoints.get(self.key) is not None
        return replace(state, selected_key=self.key) if known else state


@dataclass(frozen=True)
class RenamePair:
    """A pair got another name."""

    key: str
    name: str

    def apply(self, state: AppState) -> AppState:
        """The state with the name; an empty one is refused."""
        name = " ".join(self.name.split())[:60]
        if not name:
            return state.noticed(Level.WARNING, "A keypoint needs a name.")
        return state.with_keypoints(state.annotation.keypoints.change(self.key, name=name))


@dataclass(frozen=True)
class EnablePair:
    """A pair shall count, or not."""

    key: str
    enabled: bool

    def apply(self, state: AppState) -> AppState:
        """The state with the pair switched."""
        return state.with_keypoints(state.annotation.keypoints.change(self.key, enabled=self.enabled))


@dataclass(frozen=True)
class DeletePair:
    """A pair was deleted."""

    key: str

    def apply(self, state: AppState) -> AppState:
        """The state without it, the one before it selected."""
        pairs = state.annotation.keypoints.pairs
        keys = [pair.key for pair in pairs]
        if self.key not in keys:
            return state
        at = keys.index(self.key)
        rest = keys[:at] + keys[at + 1 :]
        selected = rest[max(0, at - 1)] if rest else None
        return replace(state.with_keypoints(state.annotation.keypoints.remove(self.key)), selected_key=selected)
