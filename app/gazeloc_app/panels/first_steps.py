"""Panel: what to do first, and what has been done of it."""

from __future__ import annotations

from typing import NamedTuple

from viser import GuiApi

from gazeloc_app import widgets
from gazeloc_app.data import ProjectData
from gazeloc_app.panels.meanwhile import meanwhile
from gazeloc_app.state import AppState

ENOUGH_PAIRS = 3
_CLICK = "set three keypoints, each on the scan and in the reconstruction (tab Keypoints); then Align."


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
        at_work = meanwhile(state)
        if at_work:
            steps = tuple(step._replace(how=f"{at_work} Look around or set keypoints meanwhile.") for step in steps)
        is_needed = not all(step.is_done for step in steps)
        widgets.set_property(self._card, "visible", is_needed)
        widgets.set_content(self._card, widgets.box(_card_html(steps)) if is_needed else "")

    def _steps(self, state: AppState) -> tuple[Step, ...]:
        annotation, recording = state.annotation, state.recording
        is_reconstructed = self._data.model(recording) is not None
        pairs = sum(pair.enabled for pair in annotation.keypoints)
        has_alignment = self._data.alignment(recording, annotation.alignment) is not None
        has_poses = self._data.trajectory(recording, self._data.poses_key(recording, annotation)) is not None
        align = self._how_to_align()
        if pairs and pairs < ENOUGH_PAIRS and not has_alignment:
            align = f"{pairs} of {ENOUGH_PAIRS} keypoints are there, then press Align in the tab Align."
        return (
            Step(is_reconstructed, "Process", self._how_to_process(recording)),
            Step(has_alignment, "Align", align),
            Step(has_poses, "Pose", "“Run everything” puts every frame and its gaze into the scan."),
            Step(
                bool(len(annotation.marks)),
                "Check",
                "Compare frames with renders on the left; mark good and bad.",
            ),
        )

    def _how_to_process(self, recording: str) -> str:
        has_model = self._data.project.recording(recording).colmap is not None
        source = "takes the cameras of your COLMAP model" if has_model else "finds the cameras from the frames"
        return f"Press “Run everything” below: it {source}, and goes on where it was stopped."

    def _how_to_align(self) -> str:
        """Tags do it where both sides can see any; else people have to click, and are told why."""
        if self._data.project.settings.tags is None:
            return f"This project names no tags: {_CLICK}"
        if not self._data.scan().frames_with_images:
            return f"The scan has no pictures of a phone, so no tag is known on it: {_CLICK}"
        return f"Tags seen by both sides align it by themselves. Without them: {_CLICK}"


def _card_html(steps: tuple[Step, ...]) -> str:
    names = " · ".join(f"{'✓' if step.is_done else '○'} {step.name}" for step in steps)
    following = next(step for step in steps if not step.is_done)
    return (
        f'<div class="gazeloc-card"><p>{names}</p><b>{widgets.text(following.name)}.</b> '
        f"{widgets.text(following.how)}</div>"
    )
