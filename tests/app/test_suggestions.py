"""Suggestions in the app: a place on the scan and in the reconstruction, its reason, and what its buttons do."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from app_project import SFM_FROM_SCAN, make_app_project
from app_steps import step, stop
from gazeloc_app.actions.picks import PickPoint, Side
from gazeloc_app.actions.suggest import ShowSuggestions
from gazeloc_app.app import App
from gazeloc_app.drawing.facing import place_to_stand
from gazeloc_app.keypoints.suggestions import Proposals, reason

from gazeloc_core.alignment.next_keypoint import Suggestion, Weakness

ON_SCAN = [(1.0, 0.02, 1.5), (0.02, 0.9, 1.6), (3.0, 0.02, 1.1), (0.9, 0.3, 0.76)]
UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture
def app(tmp_path):
    app = App(make_app_project(tmp_path, tags=False), port=0)
    app.store._render()
    yield app
    stop(app)


def proposal_after(app, places):
    for place in places:
        x, y, z = SFM_FROM_SCAN.apply(np.array(place)).tolist()
        step(app, PickPoint(Side.SCAN, place), PickPoint(Side.SFM, (x, y, z)))
    app.live.fit_wanted()
    app.store.step()
    return Proposals(app.data).of(app.store.state)


def test_each_place_is_on_the_scan_and_is_the_same_in_the_reconstruction(app):
    found = proposal_after(app, ON_SCAN)
    np.testing.assert_allclose(SFM_FROM_SCAN.apply(np.array(found.in_scan)), found.in_sfm, atol=1e-6)
    assert app.data.raycaster().closest(found.in_scan).distance[0] < 0.04
    assert min(np.linalg.norm(np.array(found.in_scan) - place) for place in ON_SCAN) > 0.5
    assert "cameras" in found.text
    assert "→" in found.text


def test_before_three_pairs_the_sentence_says_that_they_are_needed(app):
    assert "first" in Proposals(app.data).of(app.store.state).text
    assert "third" in proposal_after(app, ON_SCAN[:2]).text


def test_switched_off_there_is_none_and_its_ghost_is_gone(app):
    handles = app.server.scene._handle_from_node_name
    assert "/suggestion/ball" in handles
    step(app, ShowSuggestions(False))
    assert Proposals(app.data).of(app.store.state) is None
    assert "/suggestion/ball" not in handles


def test_a_pair_started_there_has_the_reconstructions_side(app):
    found = proposal_after(app, ON_SCAN)
    (button,) = [
        handle
        for handle in app.server.gui._gui_input_handle_from_uuid.values()
        if getattr(handle, "label", None) == "Start a pair there"
    ]
    for callback in button._impl.update_cb:
        coroutine = callback(SimpleNamespace(client_id=1, target=button))
        with pytest.raises(StopIteration):
            coroutine.send(None)
    app.store.step()
    pair = app.store.state.annotation.keypoints.pairs[-1]
    assert (pair.sfm, pair.scan, app.store.state.selected_key) == (found.in_sfm, None, pair.key)


def test_one_stands_where_nothing_is_between(app):
    found = proposal_after(app, ON_SCAN)
    eye, place = place_to_stand(app.data, app.store.state, found.in_scan), np.array(found.in_scan)
    assert 0.05 < np.linalg.norm(eye - place) <= 1.5 + 1e-9
    hit = app.data.raycaster().cast(eye, place - eye)
    assert hit.distance[0] == pytest.approx(1, abs=0.1)


@pytest.mark.parametrize(
    ("kind", "axis", "left", "words"),
    [
        ("rotation", (0.0, 0.1, 0.99), 0.5, "halves the uncertainty of the rotation about the vertical"),
        ("rotation", (1.0, 0.0, 0.0), 0.2, "more than halves the uncertainty of the rotation about a horizontal axis"),
        ("position", (0.0, 0.0, 1.0), 0.8, "takes 20 % off the uncertainty of the height"),
        ("scale", (0.0, 0.0, 0.0), 0.9, "takes 10 % off the uncertainty of the scale"),
    ],
)
def test_the_reason_is_a_sentence_in_words_of_the_field(kind, axis, left, words):
    found = Suggestion(0, 0.021, 0.012, 0.4, 0.2, Weakness(kind, axis, 0.02), left)
    assert words in reason(found, 3, UP)
    assert "cameras 2.1 → 1.2 cm" in reason(replace(found), 3, UP)
