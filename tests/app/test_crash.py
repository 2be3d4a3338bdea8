"""kill -9 while two browsers work: nothing that was shown is lost, and the history is whole."""

import multiprocessing

import pytest
from app_project import make_app_project
from crash_life import live_and_die


@pytest.mark.slow
@pytest.mark.skipif("forkserver" not in multiprocessing.get_all_start_methods(), reason="lives are forked")
def test_what_was_shown_survives_kill_9_at_any_moment(tmp_path):
    project = make_app_project(tmp_path)
    outcome = live_and_die(project.folder, kills=6, actions=60, seed=3)
    assert outcome.lost == []
    assert outcome.kills == 6
    assert outcome.shown >= 60
    assert outcome.steps > 5
