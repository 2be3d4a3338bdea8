"""Panel: what to do first, and what has been done of it."""

from __future__ import annotations

from typing import NamedTuple

from viser import GuiApi

from gazeloc_app import widgets
from gazeloc_app.data import ProjectData
from gazeloc_app.state import AppState

ENOUGH_PAIRS = 3


class Step(NamedTuple):
    """Something to do."""

    is_done: bool
    name: str
    how: str


class FirstSteps:
    """A card with the next step in words; it goes once poses have been looked at."""

    def __init__(self, gui: GuiApi, data: ProjectData):
        self._data = data
        self._card = gui.add_html("")

    def render(self, state: AppState) -> None:
        """Show how far this recording is."""
        steps = self._steps(state)
        is_needed = not all(step.is_done for step in steps)
        widgets.set_property(self._card, "visible", is_needed)
        widgets.set_content(self._card, widgets.box(_card_html(steps)) if is_needed else "")

    def _steps(self, state: AppState) -> tuple[Step, ...]:
        annotation, recording = state.annotation, state.recording
        is_reconstructed = self._data.model(recording) is not None
        pairs = sum(pair.enabled for pair in annotation.keypoints)
        has_alignment = self._data.alignment(recording, annotation.alignment) is not None
        has_poses = self._data.trajectory(recording, self._data.poses_key(recording, annotation)) is not None
        align = "Tags seen by both sides align it by themselves. Without them: set three keypoints, then Align."
        if pairs and pairs < ENOUGH_PAIRS and not has_alignment:
            align = f"{pairs} of {ENOUGH_PAIRS} keypoints are there, then press Align in the tab Align."
        return (
            Step(is_reconstructed, "Process", "Press “Run everything” below. It goes on where it was stopped."),
            Step(has_alignment, "Align", align),
            Step(has_poses, "Pose", "“Run everything” puts every frame and its gaze into the scan."),
            Step(
                bool(len(annotation.marks)),
                "Check",
                "Compare frames with renders on the left; mark good and bad.",
            ),
        )


def _card_html(steps: tuple[Step, ...]) -> str:
    names = " · ".join(f"{'✓' if step.is_done else '○'} {step.name}" for step in steps)
    following = next(step for step in steps if not step.is_done)
    return (
        f'<div class="gazeloc-card"><p>{names}</p><b>{widgets.text(following.name)}.</b> '
        f"{widgets.text(following.how)}</div>"
    )
