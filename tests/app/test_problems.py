"""Which frames deserve a look, playing, the timeline, and going to frames by clicks in our own HTML."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from app_project import FRAMES, SFM_FROM_SCAN, make_app_project
from app_steps import step, stop
from gazeloc_app import data
from gazeloc_app.actions.marks import MarkFrame
from gazeloc_app.actions.playing import Play, PlayOn, SetSpeed, TogglePlay
from gazeloc_app.actions.views import BeginAt, ShowFrame, StepFrame
from gazeloc_app.app import App
from gazeloc_app.frames.problems import frame_table, next_problem, worst_first
from gazeloc_app.frames.timeline_html import PARTS, STATUS_COLORS, timeline_html
from gazeloc_app.panels.frames import FramePanel

from gazeloc_core.frames.marks import FrameMark, FrameMarks, Mark
from gazeloc_core.trajectory import Trajectory


def trajectory_of(status):
    has_pose = np.array([name in ("registered", "tracked", "interpolated", "tag_only") for name in status])
    return Trajectory(
        timestamp_ns=np.arange(len(status)),
        status=np.array(status),
        is_keyframe=has_pose,
        centers=np.where(has_pose[:, None], 0.0, np.nan) * np.ones((1, 3)),
        wxyz=np.where(has_pose[:, None], [[1.0, 0, 0, 0]], np.nan),
    )


def table_of(*, status, score, marks=()):
    given = FrameMarks(tuple(FrameMark(frame, mark) for frame, mark in marks))
    return frame_table(len(status), trajectory_of(status), np.array(score, float), given)


STATUS = ["none", "none", "registered", "registered", "rejected", "registered", "registered"]
SCORE = [np.nan, np.nan, 0.9, 0.1, np.nan, 0.2, 0.8]


def test_a_problem_is_gone_to_once_and_around_the_end():
    table = table_of(status=STATUS, score=SCORE)
    assert table.problem.tolist() == ["no pose", "no pose", "", "low score", "no pose", "low score", ""]
    assert [next_problem(table, frame) for frame in (0, 3, 4, 5, 6)] == [3, 4, 5, 0, 0]
    assert [next_problem(table, frame, -1) for frame in (6, 5, 3, 0)] == [5, 4, 0, 5]


def test_what_people_say_goes_before_the_score():
    marks = ((3, Mark.GOOD), (6, Mark.BAD), (2, Mark.UNSURE), (400, Mark.BAD))
    table = table_of(status=STATUS, score=SCORE, marks=marks)
    assert table.problem[[2, 3, 6]].tolist() == ["marked unsure", "", "marked bad"]


def test_without_problems_there_is_none_to_go_to():
    assert next_problem(table_of(status=["registered"] * 3, score=[0.9, np.nan, 0.8]), 1) is None


def test_the_worst_comes_first_and_frames_without_a_score_do_not():
    assert worst_first(table_of(status=STATUS, score=SCORE)) == [3, 5, 6, 2]


def test_a_long_recording_is_drawn_in_parts_and_its_worst_frames_stay_seen():
    status = np.array(["registered"] * 10_000)
    status[5000] = "rejected"
    marks = FrameMarks((FrameMark(2500, Mark.BAD),))
    score = np.full(10_000, 0.9)
    content = timeline_html(trajectory_of(status), score, None, marks)
    assert len(content) < 30 * PARTS
    assert f"{STATUS_COLORS['rejected']} 50.00%" in content
    assert "left:25.00%" in content


@pytest.mark.parametrize(
    ("part", "shown"),
    [
        (["registered", "tracked"], "registered"),  # keyframes stay seen while there is room for them
        (["tracked", "registered", "tracked"], "tracked"),
        (["registered", "registered", "tracked"], "registered"),
        (["tracked", "interpolated", "registered"], "interpolated"),
    ],
)
def test_a_part_of_the_strip_shows_its_worst_or_what_most_of_it_is(part, shown):
    status = np.array(part * PARTS)
    content = timeline_html(trajectory_of(status), np.full(len(status), np.nan), None, FrameMarks())
    assert f"linear-gradient(90deg,{STATUS_COLORS[shown]} 0.00% 100.00%)" in content


def test_a_recording_without_anything_has_a_timeline_too():
    assert "no pose 3" in timeline_html(None, np.full(3, np.nan), None, FrameMarks())


@pytest.fixture
def app(tmp_path):
    app = App(make_app_project(tmp_path), port=0)
    app.store._render()
    yield app
    stop(app)


def test_the_player_goes_by_the_recordings_time_and_its_speed_and_stops_at_the_end(app):
    step(app, Play(True))
    for elapsed_s, frame in ((0.1, 0), (0.2, 1), (0.5, 3)):  # a frame lasts 0.25 s
        app._player.advance(elapsed_s)
        step(app)
        assert app.store.state.frame == frame
    step(app, SetSpeed(4.0))
    app._player.advance(0.5)
    step(app, SetSpeed(99.0))
    assert app.store.state.speed == 4.0
    assert app.store.state.frame == 11
    step(app, ShowFrame(2))  # by hand, while it plays
    app._player.advance(0.07)
    step(app)
    assert app.store.state.frame == 3
    app._player.advance(100)
    step(app)
    assert app.store.state.frame == FRAMES - 1
    app._player.advance(0.1)
    step(app)
    assert not app.store.state.is_playing


def test_a_step_of_the_player_after_the_stop_does_nothing(app):
    step(app, TogglePlay(), TogglePlay(), PlayOn("walk", 5))
    assert app.store.state.frame == 0
    step(app, Play(True), PlayOn("another", 5))
    assert app.store.state.frame == 0


def ask(app, url):
    return asyncio.run(app._routes().answer(url))


def test_a_click_in_the_timeline_goes_to_the_frame(app):
    assert ask(app, "/show/walk/7").status == 204
    step(app)
    assert app.store.state.frame == 7


@pytest.mark.parametrize("url", ["/show/walk/16", "/show/walk/-1", "/show/walk/x", "/show/other/1", "/show/walk/1e3"])
def test_a_click_that_cannot_be_is_refused(app, url):
    assert ask(app, url).status == 404
    step(app)
    assert app.store.state.frame == 0


def test_the_panel_shows_marks_and_their_note(app):
    step(app, ShowFrame(3), MarkFrame(Mark.BAD))
    (panel,) = (view.__self__ for view in app.store._views if isinstance(view.__self__, FramePanel))
    assert "marked bad" in panel._facts.content


def test_a_picture_through_the_original_lens_has_the_recordings_own_shape(app):
    shapes = []
    for query in ("rev=1", "rev=1&lens=1"):
        body = ask(app, f"/frames/walk/2.jpg?{query}").body
        shapes.append(cv2.imdecode(np.frombuffer(body, np.uint8), cv2.IMREAD_COLOR).shape[:2])
    camera, lens = app.data.camera("walk"), app.data.recording("walk").camera
    assert shapes == [(camera.height, camera.width), (lens.height, lens.width)]


def test_two_alignments_in_turns_are_placed_once_each(app, monkeypatch):
    placed = []
    monkeypatch.setattr(data, "localize_sfm", lambda *arguments: placed.append(arguments) or len(placed))
    monkeypatch.setattr(app.data, "alignment", lambda _, key: SimpleNamespace(scan_from_sfm=SFM_FROM_SCAN.inverse()))
    assert [app.data.trajectory("walk", key) for key in "abababcbcb"] == [1, 2, 1, 2, 1, 2, 3, 2, 3, 2]


def test_quick_steps_add_up_and_end_at_the_ends(app):
    step(app, *[StepFrame(1, FRAMES - 1)] * 5)
    assert app.store.state.frame == 5
    step(app, *[StepFrame(-1, FRAMES - 1)] * 9)
    assert app.store.state.frame == 0
    step(app, StepFrame(99, FRAMES - 1))
    assert app.store.state.frame == FRAMES - 1


def test_the_first_pose_is_not_gone_to_where_somebody_went_on_already(app):
    step(app, BeginAt(4))
    assert app.store.state.frame == 4
    step(app, BeginAt(6))
    assert app.store.state.frame == 4
