"""kill -9 while two pages are at work: what they have shown is there after the start, in both, by itself."""

import multiprocessing

import pytest
from app_project import make_app_project
from crash_pages import work_and_die

pytestmark = [
    pytest.mark.e2e,
    pytest.mark.skipif("forkserver" not in multiprocessing.get_all_start_methods(), reason="lives are forked"),
]


def test_what_pages_have_shown_survives_kill_9_and_they_come_back_to_it(browser, tmp_path):
    outcome = work_and_die(browser, make_app_project(tmp_path).folder, kills=3, actions=24, seed=5)
    assert outcome.lost == []
    assert outcome.kills == 3
    assert outcome.actions >= 24
    assert outcome.shown > 6
    assert outcome.steps > 3
