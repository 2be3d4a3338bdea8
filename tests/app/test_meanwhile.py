"""No panel asks for what is under way already."""

from unittest.mock import MagicMock

import pytest
from app_project import make_app_project
from gazeloc_app.actions.jobs import StartJob
from gazeloc_app.data import ProjectData
from gazeloc_app.panels.alignment import AlignmentPanel
from gazeloc_app.panels.comparison import ComparisonHtml
from gazeloc_app.panels.export import ExportPanel
from gazeloc_app.panels.meanwhile import meanwhile
from gazeloc_app.state import AppState
from gazeloc_app.work import tasks

from gazeloc_core.resources import static_file

ABOUT_WALK = (("recording", "walk"),)
RUN = StartJob("Run everything", tasks.run_all, ABOUT_WALK)


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    return ProjectData(make_app_project(tmp_path_factory.mktemp("project")))


def said(data, state):
    """What the panels that want poses or an alignment say about their absence."""
    gui, dispatch = MagicMock(), MagicMock()
    gui.add_html.side_effect = lambda *_, **__: MagicMock(content="")
    comparison = ComparisonHtml(gui, static_file("comparison.html"), data)
    comparison.show(state, 0)
    alignment = AlignmentPanel(gui, data, dispatch)
    alignment.render(state)
    export = ExportPanel(gui, data.project.folder, data, dispatch)
    export.render(state)
    return comparison._html.content, alignment._evidence.content, export._first.content


def test_a_panel_says_what_to_press_and_while_that_runs_that_it_does(data):
    state = AppState(("walk",), "walk")
    for sentence in said(data, state):
        assert "“Run everything” in the tab" in sentence or "press Align" in sentence
        assert "at work" not in sentence
    for sentence in said(data, RUN.apply(state)):
        assert "“Run everything” is at work, see the top right." in sentence
        assert "press" not in sentence.lower()


def test_only_work_that_answers_counts_and_only_for_the_recording_that_is_open():
    state = AppState(("walk", "sit"), "walk")
    figures = StartJob("Draw the figures", tasks.draw_figures, ABOUT_WALK).apply(state)
    assert meanwhile(figures, tasks.run_all) == ""
    assert meanwhile(figures) == "“Draw the figures” is at work, see the top right."
    assert meanwhile(RUN.apply(figures), tasks.run_all) == "“Run everything” is next, see the top right."
    other = StartJob("Run everything", tasks.run_all, (("recording", "sit"),)).apply(state)
    assert meanwhile(other) == ""
