"""Above all tabs: the last sentence for the user, what was under way last time, the job that runs, those that wait."""

from __future__ import annotations

from collections.abc import Callable

from viser import GuiApi

from gazeloc_app import widgets
from gazeloc_app.actions.action import Action
from gazeloc_app.actions.jobs import CancelJob, DismissJobs, ResumeJobs
from gazeloc_app.state import AppState, EndedJob, Job


class JobBar:
    """The notice and the list of jobs; stays above all tabs."""

    def __init__(self, gui: GuiApi, dispatch: Callable[[Action], None]):
        self._running: int | None = None
        self._dispatch = dispatch
        self._notice = gui.add_html("", visible=False)
        self._offer = gui.add_html("", visible=False)
        self._resume = gui.add_button(
            "Go on with it", visible=False, hint="What was finished before is not done again."
        )
        self._dismiss = gui.add_button("Dismiss", visible=False, color="gray", hint="Nothing is lost: start it anew.")
        self._bar = gui.add_progress_bar(0.0, visible=False, animated=True)
        self._text = gui.add_html("", visible=False)
        self._cancel = gui.add_button("Cancel", visible=False, color="gray", hint="What was there before stays.")
        self._waiting = gui.add_html("", visible=False)
        for button, action in ((self._resume, ResumeJobs()), (self._dismiss, DismissJobs())):
            widgets.on_user(button, lambda _, action=action: dispatch(action), event="on_click")  # type: ignore[misc]
        widgets.on_user(self._cancel, lambda _: self._cancel_running(), event="on_click")

    def render(self, state: AppState) -> None:
        """Show the jobs and the notice of the state."""
        self._render_notice(state)
        self._render_offer(state)
        job = state.job
        self._running = job.number if job is not None else None
        for handle in (self._bar, self._text, self._cancel):
            widgets.set_property(handle, "visible", job is not None)
        if job is not None:
            widgets.set_value(self._bar, round(100 * job.fraction, 1))
            widgets.set_content(self._text, widgets.box(_progress_html(job, state.job_title(job))))
            widgets.set_property(self._cancel, "disabled", job.is_cancelling)
        widgets.set_property(self._waiting, "visible", bool(state.waiting_jobs))
        widgets.set_content(self._waiting, widgets.box("".join(_waiting_html(job) for job in state.waiting_jobs)))

    def _render_notice(self, state: AppState) -> None:
        notice = state.notice
        if notice is not None:
            color = widgets.LEVEL_COLORS[notice.level.value]
            widgets.set_content(self._notice, widgets.box(widgets.colored(notice.text, color)))
        widgets.set_property(self._notice, "visible", notice is not None)

    def _render_offer(self, state: AppState) -> None:
        jobs = state.offered_jobs
        if jobs:
            names = ", ".join(f"“{state.job_title(job)}”" for job in jobs)
            sentence = f"GazeLoc was ended while it worked on {names}."
            widgets.set_content(self._offer, widgets.box(widgets.text(sentence)))
            name = state.job_title(jobs[0]) if len(jobs) == 1 else f"{len(jobs)} jobs"
            widgets.set_property(self._resume, "label", f"Go on with {name}")
        for handle in (self._offer, self._resume, self._dismiss):
            widgets.set_property(handle, "visible", bool(jobs))

    def _cancel_running(self) -> None:
        if self._running is not None:
            self._dispatch(CancelJob(self._running))


class JobLogs:
    """What the running job has reported, and how the last ones ended."""

    def __init__(self, gui: GuiApi, folder: str):
        with gui.add_folder("What the jobs said", expand_by_default=False):
            self._running = gui.add_html("", visible=False)
            self._ended = gui.add_html("")
        self._folder = folder
        self._seen: object = None

    def render(self, state: AppState) -> None:
        """Show the logs of the state."""
        widgets.set_property(self._running, "visible", state.job is not None)
        if state.job is not None:
            log = _log_html(state.job_title(state.job), "", state.job.log, is_open=True)
            widgets.set_content(self._running, widgets.box(log))
        seen = (state.recording, state.ended_jobs, state.job is None)
        if seen == self._seen:  # what a person has unfolded stays so while a job reports
            return
        self._seen = seen
        parts = [_ended_html(job, state.job_title(job)) for job in state.ended_jobs]
        if not parts and state.job is None:
            parts = ["Nothing has run since GazeLoc was started."]
        parts.append(f"<div>{widgets.colored(f'Every line is kept in {self._folder}', widgets.MUTED)}</div>")
        widgets.set_content(self._ended, widgets.box("".join(parts)))


def _progress_html(job: Job, title: str) -> str:
    if job.is_cancelling:
        return widgets.text(f"{title} · cancelling …")
    text = " · ".join(part for part in (title, job.text) if part)
    left = f" · <b>{widgets.text(job.remaining)}</b>" if job.remaining else ""
    return widgets.text(text) + left


def _waiting_html(job: Job) -> str:
    button = (
        f'<button type="button" title="Take it off the list" aria-label="Take off {widgets.text(job.name)}" '
        f'class="gazeloc-small" onclick="gazeloc.ask(\'cancel-job\',{{number:{job.number}}})">✕</button>'
    )
    return f'<div style="display:flex;gap:6px;align-items:center">{button} waits: {widgets.text(job.name)}</div>'


def _ended_html(job: EndedJob, title: str) -> str:
    color = widgets.LEVEL_COLORS[job.notice.level.value]
    return _log_html(title, widgets.colored(job.notice.text, color), job.log)


def _log_html(name: str, outcome: str, lines: tuple[str, ...], *, is_open: bool = False) -> str:
    text = widgets.text("\n".join(lines) or "It reported nothing.")
    head = f"<b>{widgets.text(name)}</b> {outcome}"
    body = f'<pre style="margin:2px 0 6px;font-size:11px;white-space:pre-wrap">{text}</pre>'
    return f"<details{' open' if is_open else ''}><summary>{head}</summary>{body}</details>"
