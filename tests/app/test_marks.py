"""Marks of frames in the app: of the frame that is shown, undone and redone, on the disk and in the history."""

from __future__ import annotations

from itertools import pairwise

from app_steps import step, stop
from gazeloc_app.actions.history import Redo, Undo
from gazeloc_app.actions.marks import MarkFrame, NoteFrame
from gazeloc_app.actions.views import ShowFrame
from gazeloc_app.annotation.steps import describe
from gazeloc_app.app import App

from gazeloc_core.frames.marks import FrameMark, Mark


def marks(app):
    return app.store.state.annotation.marks


def test_the_frame_that_is_shown_is_marked_saved_and_undone(app, project):
    step(app, ShowFrame(3), MarkFrame(Mark.BAD), NoteFrame(3, "too far left"), ShowFrame(5), MarkFrame(Mark.GOOD))
    assert marks(app).marks == (FrameMark(3, Mark.BAD, "too far left"), FrameMark(5, Mark.GOOD))
    assert project.marks("walk") == marks(app)
    step(app, Undo(), Undo())
    assert project.marks("walk").marks == (FrameMark(3, Mark.BAD),)
    step(app, Redo())
    assert project.marks("walk").get(3).note == "too far left"


def test_the_same_mark_again_takes_it_away_and_another_keeps_the_note(app):
    step(app, MarkFrame(Mark.GOOD), NoteFrame(0, "look"), MarkFrame(Mark.UNSURE))
    assert marks(app).get(0) == FrameMark(0, Mark.UNSURE, "look")
    step(app, MarkFrame(Mark.UNSURE))
    assert len(marks(app)) == 0


def test_a_note_makes_an_unmarked_frame_unsure_and_an_empty_one_does_nothing(app):
    step(app, NoteFrame(2, "  "))
    assert len(marks(app)) == 0
    step(app, NoteFrame(2, "hm"))
    assert marks(app).get(2) == FrameMark(2, Mark.UNSURE, "hm")


def test_marks_survive_a_new_start_with_their_history(app, project):
    step(app, ShowFrame(3), MarkFrame(Mark.BAD), ShowFrame(4), MarkFrame(Mark.GOOD))
    stop(app)
    again = App(project, port=0)
    try:
        assert [one.frame_index for one in again.store.state.annotation.marks.marks] == [3, 4]
        step(again, Undo())
        assert [one.frame_index for one in again.store.state.annotation.marks.marks] == [3]
    finally:
        stop(again)


def test_the_history_says_what_was_marked(app):
    step(app, ShowFrame(3), MarkFrame(Mark.BAD), NoteFrame(3, "x"), MarkFrame(Mark.BAD))
    states = [*app.store.state.past, app.store.state.annotation]
    told = [describe(before, after) for before, after in pairwise(states)]
    assert told == ["Frame 3 marked bad", "Note of frame 3 changed", "Frame 3 no longer marked"]
