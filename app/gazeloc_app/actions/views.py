"""What is shown, in every browser alike."""

from __future__ import annotations

from dataclasses import dataclass, replace

from gazeloc_app.state import AppState, Coloring, Layer, Level
from gazeloc_core.surfaces.glb import Rgb


@dataclass(frozen=True)
class ShowFrame:
    """A frame of the recording was chosen."""

    frame: int

    def apply(self, state: AppState) -> AppState:
        """The state with the frame."""
        return replace(state, frame=max(0, self.frame))


@dataclass(frozen=True)
class StepFrame:
    """Some frames on or back, from wherever quick steps before it led; `last` is the recording's last frame."""

    step: int
    last: int

    def apply(self, state: AppState) -> AppState:
        """The state with the frame."""
        return replace(state, frame=min(max(state.frame + self.step, 0), self.last))


@dataclass(frozen=True)
class BeginAt:
    """The first frame worth showing is known; it is not shown where somebody went to another one meanwhile."""

    frame: int

    def apply(self, state: AppState) -> AppState:
        """The state with the frame, where it is still at its first."""
        return replace(state, frame=self.frame) if state.frame == 0 else state


@dataclass(frozen=True)
class CompareWith:
    """The render from other poses shall show beside that of the poses that are shown."""

    poses: str
    """An alignment's key, a method, or "" for none."""

    def apply(self, state: AppState) -> AppState:
        """The state with it."""
        return state.annotate(replace(state.annotation, compared_with=self.poses))


@dataclass(frozen=True)
class DrawTags:
    """The tags that were found shall be drawn into the frame, or not."""

    is_on: bool

    def apply(self, state: AppState) -> AppState:
        """The state with it."""
        return state.with_layers(draws_tags=self.is_on)


@dataclass(frozen=True)
class ShowLayer:
    """A layer was switched on or off."""

    layer: Layer
    is_visible: bool

    def apply(self, state: AppState) -> AppState:
        """The state with the layer switched."""
        return state.with_layers(hidden=state.layers.with_visible(self.layer, self.is_visible).hidden)


@dataclass(frozen=True)
class TintLayer:
    """A layer was tinted, or got its own colours back."""

    layer: Layer
    tint: Rgb | None
    stroke: int = 0
    """Tells one pull at the colour field from the next; 0 for a step of its own."""

    def apply(self, state: AppState) -> AppState:
        """The state with the tint; all colours of one pull are one step."""
        return state.annotate_in_stroke(state.annotation.with_tint(self.layer, self.tint), ("tint", self.stroke))


MAX_THINNING = 100


@dataclass(frozen=True)
class ThinCameras:
    """Every `step`-th camera of the recording shall be drawn; None: as many as leave the room to be seen."""

    step: int | None
    stroke: int = 0
    """Tells one pull at the slider from the next; 0 for a step of its own."""

    def apply(self, state: AppState) -> AppState:
        """The state with it; all values of one pull are one step."""
        step = None if self.step is None else min(max(self.step, 1), MAX_THINNING)
        thinned = replace(state.annotation, layers=replace(state.layers, thinning=step))
        return state.annotate_in_stroke(thinned, ("thinning", self.stroke))


@dataclass(frozen=True)
class ColorCameras:
    """The colours of the recording's cameras shall stand for something else."""

    coloring: Coloring

    def apply(self, state: AppState) -> AppState:
        """The state with it."""
        return state.with_layers(coloring=self.coloring)


@dataclass(frozen=True)
class UseSafeColors:
    """The sets of cameras shall have the colours for colour-blind eyes, or the usual ones."""

    is_on: bool

    def apply(self, state: AppState) -> AppState:
        """The state with it."""
        return replace(state, are_colors_safe=self.is_on)


@dataclass(frozen=True)
class NameRenderer:
    """The renderer of pictures is known; `note` is the sentence to show where it stands in for the usual one."""

    note: str

    def apply(self, state: AppState) -> AppState:
        """The state with the sentence."""
        return replace(state, renderer_note=self.note)


@dataclass(frozen=True)
class ScanPrepared:
    """The scan is ready for the screen: views look at it anew."""

    def apply(self, state: AppState) -> AppState:
        """The state with that said; what else was said meanwhile stays."""
        if state.notice is not None and state.notice.level is not Level.INFO:
            return state
        return state.noticed(Level.INFO, "The scan is ready.")
