"""The alignment follows the keypoints: at every change, as one step, and never over what a person chose otherwise."""

from __future__ import annotations

import time

import numpy as np
import pytest
from app_project import SFM_FROM_SCAN, make_app_project
from app_steps import step, stop
from gazeloc_app.actions.choices import ChooseAlignment
from gazeloc_app.actions.history import Undo
from gazeloc_app.actions.live import FitFound, FollowKeypoints
from gazeloc_app.actions.pairs import EnablePair, RenamePair
from gazeloc_app.actions.picks import PickPoint, Side
from gazeloc_app.app import App
from gazeloc_app.keypoints.live_alignment import is_following
from gazeloc_app.keypoints.residuals import pair_residuals

from gazeloc_core.alignment.alignment import AlignmentMethod, judge
from gazeloc_core.alignment.correspondences import gather
from gazeloc_core.keypoints import KeypointSet
from gazeloc_core.stages.registration import save_alignment
from gazeloc_core.transforms import Similarity

ON_SCAN = [(1.0, 0.02, 1.5), (0.02, 0.9, 1.6), (3.0, 0.02, 1.1), (0.9, 0.3, 0.76), (2.9, 1.9, 0.47)]


@pytest.fixture
def app(tmp_path):
    """The app without tags, its loop not running."""
    app = App(make_app_project(tmp_path, tags=False), port=0)
    app.store._render()
    yield app
    stop(app)


def pair(app, place, off_m=(0.0, 0.0, 0.0)):
    x, y, z = SFM_FROM_SCAN.apply(np.array(place) + off_m).tolist()
    step(app, PickPoint(Side.SCAN, place))
    step(app, PickPoint(Side.SFM, (x, y, z)))


def fit(app):
    """What the thread does: fit, and what it found applied."""
    is_fitted = app.live.fit_wanted()
    app.store.step()
    return is_fitted


def error_m(app):
    alignment = app.data.alignment("walk", app.store.state.annotation.alignment)
    there = alignment.scan_from_sfm.apply(SFM_FROM_SCAN.apply(np.array(ON_SCAN)))
    return float(np.linalg.norm(there - ON_SCAN, axis=1).max())


def test_the_third_pair_aligns_and_undo_takes_it_and_its_alignment_back(app):
    for place in ON_SCAN[:2]:
        pair(app, place)
        fit(app)
    assert app.store.state.annotation.alignment is None
    assert "three" in app.store.state.fit_note
    pair(app, ON_SCAN[2])
    assert fit(app)
    assert error_m(app) < 1e-6
    assert app.store.state.fit_note == ""
    assert app.store.state.annotation.alignment_by_person
    steps = len(app.store.state.past)
    step(app, Undo())
    assert (app.store.state.annotation.alignment, len(app.store.state.past)) == (None, steps - 1)
    assert len([p for p in app.store.state.annotation.keypoints if p.counts]) == 2


def test_the_fit_is_that_of_the_evidence_saved_and_read_again(app):
    for place in ON_SCAN:
        pair(app, place, (0.004, -0.003, 0.002))
    fit(app)
    key = app.store.state.annotation.alignment
    assert (app.project.alignments_folder("walk") / f"{key}.json").is_file()
    assert app.project.settings.chosen["walk"].alignment == key
    alignment = app.data.alignment("walk", key)
    assert alignment.evidence.is_fitted
    assert len(alignment.evidence.keypoints) == len(ON_SCAN)
    assert alignment.verdicts


def test_what_does_not_count_asks_for_no_fit(app):
    for place in ON_SCAN[:4]:
        pair(app, place)
    fit(app)
    key = app.store.state.annotation.alignment
    step(app, PickPoint(Side.SCAN, (1.0, 1.0, 0.01)))
    assert not fit(app)
    step(app, EnablePair("k4", False))
    assert fit(app)
    assert app.store.state.annotation.alignment != key


def test_an_alignment_of_another_kind_stays_until_a_person_asks(app):
    for place in ON_SCAN[:4]:
        pair(app, place)
    fit(app)
    moved = judge(Similarity.identity(), gather(None, None, KeypointSet()), method=AlignmentMethod.ICP_POINT_TO_PLANE)
    save_alignment(app.project, "walk", moved)
    step(app, ChooseAlignment(moved.key))
    pair(app, ON_SCAN[4])
    assert not fit(app)
    assert not is_following(app.data, app.store.state)
    assert app.store.state.annotation.alignment == moved.key
    step(app, FollowKeypoints(True))
    assert fit(app)
    assert error_m(app) < 1e-6
    assert is_following(app.data, app.store.state)
    step(app, Undo())
    assert app.store.state.annotation.alignment == moved.key
    assert len(app.store.state.annotation.keypoints) == 5


def test_an_answer_that_comes_too_late_is_dropped(app):
    pair(app, ON_SCAN[0])
    asked = app.store.state.annotation.keypoints
    step(app, RenamePair("k1", "lamp"))
    step(app, FitFound("walk", asked, "0123456789ab"))
    assert app.store.state.annotation.alignment is None


def test_a_wrong_pair_shows_in_its_row_and_what_each_pair_does_is_in_centimetres(app):
    for place in ON_SCAN:
        pair(app, place)
    pair(app, (2.2, 1.2, 0.01), (0.3, 0.0, 0.0))
    fit(app)
    rows = pair_residuals(app.data, app.store.state)
    assert [row.is_used for row in rows.values()] == [True] * 5 + [False]
    assert rows["k6"].left_out_m == pytest.approx(0.3, abs=1e-3)
    assert rows["k6"].cameras_move_m == 0.0
    step(app, Undo(), Undo())
    fit(app)
    rows = pair_residuals(app.data, app.store.state)
    assert all(row.left_out_m < 1e-6 for row in rows.values())
    assert all(row.cameras_move_m < 1e-6 for row in rows.values())


def test_the_running_app_aligns_by_itself(tmp_path):
    app = App(make_app_project(tmp_path, tags=False), port=0)
    app.start()
    try:
        for place in ON_SCAN:
            x, y, z = SFM_FROM_SCAN.apply(np.array(place)).tolist()
            for side, point in ((Side.SCAN, place), (Side.SFM, (x, y, z))):
                app.store.dispatch(PickPoint(side, point))
        end = time.monotonic() + 20
        while time.monotonic() < end and len(app.store.state.annotation.keypoints) < 5:
            time.sleep(0.02)
        while time.monotonic() < end and app.store.state.annotation.alignment is None:
            time.sleep(0.02)
        assert error_m(app) < 1e-6
    finally:
        app.stop()
