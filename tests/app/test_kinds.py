"""Every action and every field of the state has its kind, and keeps to it, whatever people do."""

import importlib
import inspect
import pkgutil
from dataclasses import fields, replace

import pytest
from any_action import RECORDINGS, actions
from gazeloc_app import actions as actions_package
from gazeloc_app.actions.choices import OpenRecording
from gazeloc_app.actions.history import Redo, Undo
from gazeloc_app.annotation.history import History
from gazeloc_app.annotation.kinds import ACTIONS, FIELDS, Kind
from gazeloc_app.annotation.steps import describe
from gazeloc_app.state import Annotation, AppState
from hypothesis import given, settings
from hypothesis import strategies as st

MODULES = [
    importlib.import_module(f"gazeloc_app.actions.{module.name}")
    for module in pkgutil.iter_modules(actions_package.__path__)
]
CLASSES = {
    value
    for module in MODULES
    for _, value in inspect.getmembers(module, inspect.isclass)
    if value.__module__ == module.__name__ and hasattr(value, "apply") and value.__name__ != "Action"
}
begun = History((Annotation(),), 0)
any_actions = st.lists(actions(lambda name: begun), max_size=30)
MAY_CHANGE = {  # beside news, which may always come along
    Kind.DECISION: {Kind.DECISION, Kind.HISTORY, Kind.PLACE},
    Kind.HISTORY: {Kind.DECISION, Kind.HISTORY, Kind.PLACE},
    Kind.PLACE: {Kind.PLACE},
    Kind.SETTING: {Kind.SETTING},
    Kind.NEWS: set(),
}


def changed(before: AppState, after: AppState) -> set[Kind]:
    names = (name for name in FIELDS if getattr(before, name) != getattr(after, name))
    return {FIELDS[name] for name in names} - {Kind.NEWS}


def test_no_action_and_no_field_is_without_its_kind():
    assert len(CLASSES) > 40
    assert set(ACTIONS) == CLASSES
    assert set(FIELDS) == {field.name for field in fields(AppState)}


def test_hypothesis_makes_every_action():
    made = set()

    @settings(max_examples=400, database=None, derandomize=True)
    @given(actions(lambda name: begun))
    def make(action):
        made.add(type(action))

    make()
    assert made == CLASSES


@settings(max_examples=200)
@given(any_actions)
def test_an_action_changes_only_what_its_kind_may(done):
    state = AppState(RECORDINGS, "walk")
    for action in done:
        before, state = state, action.apply(state)
        kind = ACTIONS[type(action)]
        if isinstance(action, OpenRecording) and state.recording != before.recording:
            continue  # brings the other recording's own history
        assert changed(before, state) <= MAY_CHANGE[kind], (action, changed(before, state))
        if kind is Kind.HISTORY and state.annotation is not before.annotation:
            assert sorted(map(id, History.of(state).annotations)) == sorted(map(id, History.of(before).annotations))


@settings(max_examples=200)
@given(any_actions)
def test_undo_all_and_redo_all_gives_every_decision_back(done):
    state = AppState(RECORDINGS, "walk")
    for action in done:
        state = action.apply(state)
    wanted, passed = History.of(state), []
    for _ in wanted.past:
        state = Undo().apply(state)
        passed.append(state.annotation)
    assert passed == list(reversed(wanted.past))
    assert Undo().apply(state).annotation is state.annotation
    for step in wanted.annotations[1 : wanted.position + 1]:
        state = Redo().apply(state)
        assert state.annotation is step
    assert History.of(state).is_same(wanted)


@settings(max_examples=100)
@given(any_actions)
def test_every_step_has_a_sentence_of_its_own(done):
    state = AppState(RECORDINGS, "walk")
    for action in done:
        before, state = state, action.apply(state)
        if len(state.past) == len(before.past) + 1 and state.past[-1] is before.annotation:
            assert describe(before.annotation, state.annotation) != "Nothing changed"


ABOUT_ONE_RECORDING = {
    *("recording", "annotation", "past", "future", "frame", "selected_key", "fit_note", "is_playing", "notice"),
    *("data_revision", "suggested"),
}


@pytest.mark.parametrize("name", sorted({field.name for field in fields(AppState)} - ABOUT_ONE_RECORDING))
def test_another_recording_keeps_what_is_not_about_the_one_before(name):
    before = replace(AppState(RECORDINGS, "walk"), **{name: ("something",)})
    after = OpenRecording("sit", lambda: begun).apply(before)
    assert after.recording == "sit"
    assert getattr(after, name) == ("something",)
