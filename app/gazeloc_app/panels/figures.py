"""Panel: the paper's figures for the recording that is open."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from viser import GuiApi

from gazeloc_app import widgets
from gazeloc_app.actions.action import Action
from gazeloc_app.actions.jobs import StartJob
from gazeloc_app.data import ProjectData
from gazeloc_app.panels.meanwhile import meanwhile
from gazeloc_app.plots import to_plotly
from gazeloc_app.state import AppState
from gazeloc_app.work import tasks
from gazeloc_app.work.outcome import Task

NONE = "(not drawn yet)"
NONE_YET = "Press “Draw the figures”; they are drawn from the tags that “Run everything” found."


class FigurePanel:
    """The buttons that draw the figures, and the one of them that is shown."""

    def __init__(self, gui: GuiApi, data: ProjectData, dispatch: Callable[[Action], None]):
        self._data = data
        self._dispatch = dispatch
        self._recording = ""
        self._seen: object = None
        self._draw = gui.add_button("Draw the figures", hint="From the tags that were found; takes some seconds.")
        self._advise = gui.add_button(
            "Draw which tags to print",
            color="gray",
            hint="Section IX: the safe range of a tag; which size and number this room needs. Minutes the first time.",
        )
        self._which = gui.add_dropdown("Figure", (NONE,), hint="Which of the figures that were drawn shows.")
        self._notes = gui.add_html("")
        self._gui, self._place = gui, gui.add_folder(None)
        self._plot: Any = None
        """Made for the first figure: every page that opens takes a second to read the library that draws it."""
        widgets.on_user(self._draw, lambda _: self._start("Draw the figures", tasks.draw_figures), event="on_click")
        widgets.on_user(
            self._advise, lambda _: self._start("Draw which tags to print", tasks.draw_advice), event="on_click"
        )
        widgets.on_user(self._which, lambda event: self._show(str(event.target.value)))

    def render(self, state: AppState) -> None:
        """Show the state's recording."""
        self._recording = state.recording
        for button in (self._draw, self._advise):
            widgets.set_property(button, "disabled", state.has_job(button.label))
        at_work = meanwhile(state, tasks.run_all, tasks.draw_figures, tasks.draw_advice)
        seen = (state.recording, state.data_revision, at_work)
        if seen == self._seen:
            return
        self._seen = seen
        charts, notes = self._data.figures(state.recording) or ({}, ())
        options = tuple(charts) or (NONE,)
        if tuple(self._which.options) != options:
            self._which.options = options
        said = "<br>".join(widgets.text(note) for note in notes)
        none_yet = widgets.card("No figure yet.", at_work or NONE_YET)
        widgets.set_content(self._notes, widgets.box(said if charts or notes else none_yet))
        self._show(str(self._which.value))

    def _show(self, name: str) -> None:
        charts, _ = self._data.figures(self._recording) or ({}, ())
        chart = charts.get(name)
        if self._plot is not None:
            widgets.set_property(self._plot, "visible", chart is not None)
        if chart is None:
            return
        if self._plot is None:
            with self._place:
                self._plot = self._gui.add_plotly(to_plotly(chart), aspect=0.9)
        else:
            self._plot.figure = to_plotly(chart)

    def _start(self, name: str, task: Task) -> None:
        self._dispatch(StartJob(name, task, (("recording", self._recording),)))
