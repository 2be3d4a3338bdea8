"""Keypoints from and to files, in the app and on the command line: one step, and a bad file changes nothing."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest
from app_project import make_app_project
from app_steps import step, stop
from fake_project import CLICKED, click
from gazeloc_app.actions.files import ImportKeypoints
from gazeloc_app.actions.history import Undo
from gazeloc_app.actions.picks import PickPoint, Side
from gazeloc_app.app import App
from gazeloc_app.cli import main
from gazeloc_app.panels.keypoint_files import FORMATS, KeypointFiles
from gazeloc_app.state import Level

from gazeloc_core.clicks.keypoint_files import WRITERS, read_keypoints
from gazeloc_core.project import Project

LIST = b"lamp,1,2,0.5\ndesk,0.5,0.25,2\n"


@pytest.fixture
def app(tmp_path):
    app = App(make_app_project(tmp_path), port=0)
    app.store._render()
    yield app
    stop(app)


@pytest.fixture
def panel(app):
    return KeypointFiles(app.server.gui, app.store.state, app.data.scan, app.store.dispatch)


@pytest.fixture
def panel_in_mm(app):
    scan = replace(app.data.scan(), metres_per_unit=0.001)
    return KeypointFiles(app.server.gui, app.store.state, lambda: scan, app.store.dispatch)


def test_reading_a_list_is_one_step_and_is_saved(app, panel):
    step(app, PickPoint(Side.SCAN, (1, 1, 1)))
    panel._read(SimpleNamespace(name="picked.txt", content=LIST))
    app.store.step()
    assert [pair.name for pair in app.project.keypoints("walk")] == ["Keypoint 1", "lamp", "desk"]
    assert "2 of them new" in app.store.state.notice.text
    step(app, Undo())
    assert [pair.name for pair in app.project.keypoints("walk")] == ["Keypoint 1"]


def test_lists_of_other_programs_are_in_the_unit_of_the_scan_file(app, panel_in_mm):
    panel_in_mm._read(SimpleNamespace(name="picked.txt", content=b"lamp,1000,2000,500\n"))
    app.store.step()
    assert [pair.scan for pair in app.store.state.annotation.keypoints] == [pytest.approx((1, 2, 0.5))]
    assert "outside" not in app.store.state.notice.text
    panel_in_mm.render(app.store.state)
    panel_in_mm._format.value = "CloudCompare, on the scan"
    sent = []
    panel_in_mm._send(SimpleNamespace(send_file_download=lambda name, content, **how: sent.append(content)))
    assert read_keypoints("x", sent[0], "scan").pairs[0].scan == pytest.approx((1000, 2000, 500))
    panel_in_mm._format.value = "CSV"
    panel_in_mm._send(SimpleNamespace(send_file_download=lambda name, content, **how: sent.append(content)))
    assert read_keypoints("x", sent[1], "scan", 0.001).pairs[0].scan == pytest.approx((1, 2, 0.5))


def test_a_list_in_the_wrong_unit_is_noticed(app, panel):
    panel._read(SimpleNamespace(name="picked.txt", content=b"lamp,1000,2000,500\ndesk,1,1,1\n"))
    app.store.step()
    assert "1 of them lie far outside of the scan" in app.store.state.notice.text


def test_a_bad_file_is_a_sentence_and_nothing_is_lost(app, panel):
    step(app, PickPoint(Side.SCAN, (1, 1, 1)))
    before = app.store.state.annotation
    panel._read(SimpleNamespace(name="bad.json", content=b"{"))
    app.store.step()
    assert app.store.state.annotation is before
    assert app.store.state.notice.level is Level.ERROR
    assert app.store.state.notice.text.startswith("bad.json: ")


@pytest.mark.parametrize("label", FORMATS)
def test_what_is_saved_in_a_browser_is_read_again(app, panel, label):
    step(app, ImportKeypoints(read_keypoints("x", LIST, "scan"), "x"), ImportKeypoints(_moved(), "y"))
    panel.render(app.store.state)
    panel._format.value = label
    sent = []
    panel._send(SimpleNamespace(send_file_download=lambda name, content, **how: sent.append((name, content))))
    ((name, content),) = sent
    assert name == f"walk-keypoints{WRITERS[FORMATS[label]][0]}"
    side = "sfm" if FORMATS[label].endswith("sfm") else "scan"
    read = read_keypoints(name, content, side)
    wanted = [getattr(pair, side) for pair in app.store.state.annotation.keypoints]
    assert [getattr(pair, side) for pair in read] == wanted


def _moved():
    return read_keypoints("y", LIST.replace(b"0.5", b"7.5"), "sfm")


def run(*arguments):
    with pytest.raises(SystemExit) as ended:
        main([str(argument) for argument in arguments])
    return ended.value.code


def test_the_command_line_exports_and_imports(home, capsys):
    click(Project.open(home / "project"), CLICKED)
    main(["keypoints", "export", str(home / "project"), str(home / "pairs.csv")])
    assert f"{len(CLICKED)} keypoints" in capsys.readouterr().out
    main(["keypoints", "import", str(home / "aligned"), str(home / "pairs.csv")])
    assert "0 of them new" in capsys.readouterr().out
    (home / "picked.txt").write_bytes(LIST)
    main(["keypoints", "import", str(home / "project"), str(home / "picked.txt"), "--side", "sfm"])
    assert [pair.sfm for pair in Project.open(home / "project").keypoints("walk")][-2:] == [(1, 2, 0.5), (0.5, 0.25, 2)]


def test_what_the_command_line_cannot_do_is_a_sentence(home, capsys):
    project = home / "project"
    (home / "bad.csv").write_text("name,enabled,oops\n")
    assert run("keypoints", "import", project, home / "bad.csv") == 2
    assert run("keypoints", "import", project, home / "missing.csv") == 2
    assert run("keypoints", "export", project, home / "out.csv") == 2
    click(Project.open(project), CLICKED)
    assert run("keypoints", "export", project, home / "out.xyz") == 2
    assert run("keypoints", "import", project, home / "bad.csv", "--recording", "nobody") == 2
    said = capsys.readouterr().err.strip().splitlines()
    assert len(said) == 5
    assert all(line.startswith("gazeloc: ") for line in said)
    assert len(Project.open(project).keypoints("walk")) == len(CLICKED)
