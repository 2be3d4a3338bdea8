"""Figures in their tab: the library that draws them is not sent to pages before there is one to draw."""

from types import SimpleNamespace

import pytest
from gazeloc_app.panels.figures import FigurePanel
from gazeloc_app.routes import Routes
from gazeloc_app.server import make_server
from gazeloc_app.state import AppState

from gazeloc_core.charts.values import Chart, Series


@pytest.fixture
def server():
    server = make_server(0, Routes())
    yield server
    server.stop()


def sent(server, kind):
    messages = server._websock_server._broadcast_buffer.message_from_id.values()
    return [message for message in messages if type(message).__name__ == kind]


def chart(title):
    return Chart(title, "x", "y", (Series("one", [0.0, 1.0], [0.0, 1.0]),))


def test_the_first_figure_brings_the_library_and_the_next_takes_its_place(server):
    figures = {}
    data = SimpleNamespace(figures=lambda _: (figures, ("a note",)) if figures else None)
    with server.gui.add_folder("Figures") as tab:
        panel = FigurePanel(server.gui, data, [].append)
        server.gui.add_button("after it")
    panel.render(AppState(("walk",), "walk"))
    assert not sent(server, "RunJavascriptMessage")
    assert not sent(server, "GuiPlotlyMessage")
    figures |= {"first": chart("First"), "second": chart("Second")}
    panel.render(AppState(("walk",), "walk", data_revision=1))
    assert panel._which.options == ("first", "second")
    (plot,) = sent(server, "GuiPlotlyMessage")
    assert plot.container_uuid == panel._place._impl.uuid
    assert panel._place._impl.parent_container_id == tab._impl.uuid
    assert len(sent(server, "RunJavascriptMessage")) == 1
    panel._show("second")
    assert panel._plot.figure.layout.title.text == "Second"
    assert panel._plot.visible
    panel._show("gone")
    assert not panel._plot.visible
    panel._show("first")
    assert panel._plot.visible
    assert len(sent(server, "GuiPlotlyMessage")) == 1
