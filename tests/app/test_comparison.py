"""What the panel “Frame” tells the page: where pictures are, which frames have a pose, and what is missing."""

import html
import re

import numpy as np
from app_steps import step
from gazeloc_app.actions.choices import ChooseAlignment
from gazeloc_app.actions.picks import PickPoint, Side
from gazeloc_app.actions.views import ShowFrame
from gazeloc_app.drawing.pictures import render_url
from gazeloc_app.panels.comparison import NO_POSE, NO_POSES
from gazeloc_app.panels.frames import FramePanel

from gazeloc_core.stages.registration import align_keypoints


def panel_of(app):
    (panel,) = (view.__self__ for view in app.store._views if isinstance(getattr(view, "__self__", None), FramePanel))
    return panel


def said(app):
    """The data of the comparison's box."""
    content = panel_of(app)._comparison._html.content
    return {name: html.unescape(value) for name, value in re.findall(r'data-([a-z-]+)="([^"]*)"', content)}


def test_before_there_are_poses_the_page_is_told_what_to_do_first(app):
    box = said(app)
    assert (box["render"], box["poses"], box["none"]) == ("", "", NO_POSES)
    assert box["frame"].startswith("/frames/walk/{}.jpg?rev=")
    assert box["show"] == "/show/walk/"


def test_the_page_is_told_which_frames_have_a_pose(app, project):
    alignment = align_keypoints(project, "walk")
    step(app, ChooseAlignment(alignment.key), ShowFrame(3))
    box, trajectory = said(app), app.data.trajectory("walk", alignment.key)
    assert box["render"] == render_url(app.data, "walk", alignment.key, "{}")
    bits = [int(bit) for digit in box["poses"] for bit in f"{int(digit, 16):04b}"]
    np.testing.assert_array_equal(bits[: len(trajectory)], trajectory.has_pose)
    assert (box["number"], box["last"]) == ("3", str(len(trajectory) - 1))
    assert box["none"] == ("" if trajectory.has_pose[3] else NO_POSE)


def test_a_page_may_remember_frames_until_their_keypoints_change(app):
    before = said(app)["marks"]
    step(app, ShowFrame(5))
    assert said(app)["marks"] == before
    step(app, PickPoint(Side.SCAN, (1, 1, 0)))
    assert said(app)["marks"] != before


def test_without_a_ground_truth_the_facts_say_that_there_are_no_errors(app, monkeypatch):
    monkeypatch.setattr(app.data, "truth", lambda _: None)
    step(app, ShowFrame(5))
    assert "no ground truth" in panel_of(app)._facts.content
