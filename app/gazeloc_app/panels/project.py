"""Panel: which recording, how its stages stand, and running them."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from viser import GuiApi

from gazeloc_app import widgets
from gazeloc_app.actions.action import Action
from gazeloc_app.actions.jobs import StartJob
from gazeloc_app.newest import Newest
from gazeloc_app.state import AppState
from gazeloc_app.work import tasks
from gazeloc_core import pipeline
from gazeloc_core.methods import Method
from gazeloc_core.project import Project
from gazeloc_core.storage.artifacts import State

_COLORS = {
    State.FRESH: widgets.GOOD,
    State.STALE: widgets.WARNING,
    State.MISSING: widgets.MUTED,
    State.FAILED: widgets.BAD,
}
_WORDS = {State.FRESH: "done", State.STALE: "outdated", State.MISSING: "to do", State.FAILED: "failed"}


class _Wanted(NamedTuple):
    recording: str
    method: Method
    running: str | None


class ProjectPanel:
    """The recording, the stages and the button that runs them."""

    def __init__(
        self,
        gui: GuiApi,
        project: Project,
        state: AppState,
        dispatch: Callable[[Action], None],
        open_recording: Callable[[str], None],
    ):
        self._project = project
        self._state = state
        self._seen: object = None
        self._recording = gui.add_dropdown(
            "Recording", state.recordings, initial_value=state.recording, hint="One scan, any number of recordings."
        )
        widgets.on_user(self._recording, lambda event: open_recording(str(event.target.value)))
        self._run = gui.add_button(
            "Run everything", hint="Every stage that is to do or outdated, from the files to gaze in the room."
        )
        self._dispatch = dispatch
        widgets.on_user(self._run, lambda _: self._run_method(), event="on_click")
        self._stages = gui.add_html("")
        self._shown: tuple[str, Method] | None = None
        self._lookup = Newest(self._show_stages, "gazeloc-stages")

    def render(self, state: AppState) -> None:
        """Show the state's recording and how its stages stand."""
        self._state = state
        widgets.set_value(self._recording, state.recording)
        widgets.set_property(self._run, "disabled", state.has_job("Run everything"))
        wanted = _Wanted(state.recording, state.annotation.method, _running_stage(state))
        stamps = pipeline.stamps(self._project, wanted.recording, wanted.method)  # a job gets on from stage to stage
        if (wanted, stamps, state.data_revision) != self._seen:
            self._seen = (wanted, stamps, state.data_revision)
            if (wanted.recording, wanted.method) != self._shown:
                note = widgets.colored(f"Looking through the files of {wanted.recording} …", widgets.MUTED)
                widgets.set_content(self._stages, widgets.box(note))
            self._lookup.ask(wanted)

    def wait(self) -> bool:
        """Wait until the table is up to date; False where that takes too long."""
        return self._lookup.wait()

    def _show_stages(self, wanted: _Wanted) -> None:
        """On a thread of its own: the first time, every file of the recording is read once."""
        statuses = pipeline.statuses(self._project, wanted.recording, wanted.method)
        rows = [_row(status, is_running=status.title == wanted.running) for status in statuses]
        if self._lookup.is_newest(wanted):
            self._shown = (wanted.recording, wanted.method)
            widgets.set_content(
                self._stages, widgets.box(widgets.html_table([f"Method {wanted.method}", "", ""], rows))
            )

    def _run_method(self) -> None:
        keywords = (("recording", self._state.recording), ("method", self._state.annotation.method))
        self._dispatch(StartJob("Run everything", tasks.run_all, keywords))


def _running_stage(state: AppState) -> str | None:
    """The title of the stage that a job works at, None where the job is about another recording."""
    job = state.job
    return None if job is None or job.recording not in (None, state.recording) else job.text.partition(":")[0]


def _row(status: pipeline.StageStatus, *, is_running: bool) -> list[str]:
    color, word = _COLORS[status.state], _WORDS[status.state]
    reason = "" if status.state is State.MISSING else status.reason[:160]  # that it waits, the stages above say
    if is_running and status.state is not State.FRESH:
        color, word, reason = widgets.GOOD, "running", ""
    return [widgets.text(status.title), widgets.colored(word, color), widgets.colored(reason, widgets.MUTED)]
