"""The loop: every action is applied, in order, whichever thread it came from; faults do not end it."""

import threading
from dataclasses import dataclass, replace

import pytest
from gazeloc_app.actions.choices import ChooseAlignment
from gazeloc_app.actions.history import Redo, Undo
from gazeloc_app.actions.jobs import JobEnded, StartJob
from gazeloc_app.actions.pairs import DeletePair, EnablePair, RenamePair, SelectPair
from gazeloc_app.actions.picks import PickPoint, PickSighting, Side
from gazeloc_app.state import AppState, Layer, LayerSettings, Level
from gazeloc_app.store import Store
from hypothesis import given
from hypothesis import strategies as st

from gazeloc_core.errors import InputError
from gazeloc_core.keypoints import Sighting


def fresh() -> AppState:
    return AppState(("walk",), "walk")


def apply(state: AppState, *actions) -> AppState:
    for action in actions:
        state = action.apply(state)
    return state


def test_two_clicks_make_one_pair_and_a_third_starts_the_next():
    state = apply(fresh(), PickPoint(Side.SCAN, (1, 2, 3)), PickPoint(Side.SFM, (4, 5, 6)))
    assert len(state.annotation.keypoints) == 1
    assert state.annotation.keypoints.pairs[0].is_complete
    state = apply(state, PickPoint(Side.SCAN, (7, 8, 9)))
    assert [pair.key for pair in state.annotation.keypoints] == ["k1", "k2"]
    assert state.selected_key == "k2"


def test_moving_changes_the_selected_pair_only():
    state = apply(fresh(), PickPoint(Side.SCAN, (1, 2, 3)), PickPoint(Side.SCAN, (9, 9, 9), move=True))
    assert [pair.scan for pair in state.annotation.keypoints] == [(9, 9, 9)]


def test_a_second_sighting_in_the_same_frame_replaces_the_first():
    state = apply(fresh(), PickSighting(Sighting(3, 10, 5)))
    state = apply(state, *(PickSighting(Sighting(frame, x, 5), "k1", (1, 2, 3)) for frame, x in [(8, 20), (3, 11)]))
    (pair,) = state.annotation.keypoints
    assert [(s.frame_index, s.x_px) for s in pair.sightings] == [(8, 20), (3, 11)]
    assert pair.sfm == (1, 2, 3)


def test_clicks_in_the_phones_frames_make_the_scans_side_and_a_click_on_the_mesh_replaces_them():
    seen = [Sighting(frame, 10.0, 5.0) for frame in (3, 3, 8)]
    state = apply(fresh(), PickSighting(seen[0], side=Side.SCAN), PickSighting(seen[1], "k1"))
    state = apply(state, PickSighting(seen[2], "k1", (1, 2, 3), 0.01, side=Side.SCAN))
    (pair,) = state.annotation.keypoints
    assert (pair.scan, pair.scan_sigma, pair.scan_sightings) == ((1, 2, 3), 0.01, (seen[0], seen[2]))
    assert (pair.sfm, pair.sightings) == (None, (seen[1],))
    (pair,) = apply(state, PickPoint(Side.SCAN, (7, 8, 9), move=True)).annotation.keypoints
    assert (pair.scan, pair.scan_sigma, pair.scan_sightings) == ((7, 8, 9), None, ())
    assert pair.sightings == (seen[1],)


def test_names_cannot_be_empty_and_disabling_takes_a_pair_out():
    state = apply(fresh(), PickPoint(Side.SCAN, (1, 2, 3)), PickPoint(Side.SFM, (4, 5, 6)), RenamePair("k1", "  "))
    assert state.annotation.keypoints.pairs[0].name == "Keypoint 1"
    assert state.notice is not None
    state = apply(state, EnablePair("k1", False))
    assert not state.annotation.keypoints.pairs[0].counts


actions = st.one_of(
    st.builds(PickPoint, st.sampled_from(Side), st.tuples(*[st.floats(-5, 5)] * 3), st.booleans()),
    st.builds(
        PickSighting,
        st.builds(Sighting, st.integers(0, 4), st.floats(0, 100), st.floats(0, 100)),
        st.none() | st.sampled_from(["k1", "k2"]),
    ),
    st.builds(SelectPair, st.none() | st.sampled_from(["k1", "k2", "k9"])),
    st.builds(RenamePair, st.sampled_from(["k1", "k2"]), st.text(max_size=5)),
    st.builds(EnablePair, st.sampled_from(["k1", "k2"]), st.booleans()),
    st.builds(DeletePair, st.sampled_from(["k1", "k2", "k3"])),
    st.builds(ChooseAlignment, st.none() | st.sampled_from(["a", "b"])),
)


@given(st.lists(actions, max_size=25))
def test_undoing_everything_gives_the_beginning_and_redoing_the_end(done):
    state = apply(fresh(), *done)
    steps = len(state.past)
    undone = apply(state, *[Undo()] * steps)
    assert undone.annotation == fresh().annotation
    assert apply(undone, *[Redo()] * steps).annotation == state.annotation


@given(st.lists(actions | st.builds(Undo) | st.builds(Redo), max_size=25))
def test_the_selection_is_always_a_pair_that_exists(done):
    state = apply(fresh(), *done)
    assert state.selected_key is None or state.annotation.keypoints.get(state.selected_key) is not None


def test_the_alignment_of_a_job_can_be_undone():
    state = apply(fresh(), StartJob("Align", print), JobEnded(Level.INFO, "Aligned.", "key", True))
    assert (state.annotation.alignment, state.annotation.alignment_by_person) == ("key", True)
    assert apply(state, Undo()).annotation.alignment is None


@dataclass(frozen=True)
class Count:
    def apply(self, state: AppState) -> AppState:
        return replace(state, frame=state.frame + 1)


@dataclass(frozen=True)
class Fail:
    error: Exception

    def apply(self, state: AppState) -> AppState:
        raise self.error


def test_actions_from_many_threads_are_all_applied():
    store = Store(fresh())
    store.start()
    threads = [threading.Thread(target=lambda: [store.dispatch(Count()) for _ in range(250)]) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    store.stop()
    assert store.state.frame == 2000
    assert store.applied == 2000


def test_a_fault_says_whether_it_kept_something_from_being_saved():
    def fail(before: AppState, after: AppState) -> None:
        raise ZeroDivisionError("a fault")

    said = []
    for add in (Store.add_saver, Store.add_effect):
        store = Store(fresh())
        add(store, fail)
        store.dispatch(SelectPair(None))
        store.step()
        said.append(store.state.notice.text)
    assert said == ["This was not saved: a fault.", "A fault in GazeLoc stopped what should have followed: a fault."]


def test_views_see_each_batch_and_effects_its_two_ends():
    store, seen, effects = Store(fresh()), [], []
    store.add_view(lambda state: seen.append(state.frame))
    store.add_effect(lambda before, after: effects.append((before.frame, after.frame)))
    for _ in range(3):
        store.dispatch(Count())
    assert store.step() == 3
    assert seen == [3]
    assert effects == [(0, 3)]


@pytest.mark.parametrize(
    ("error", "text"), [(InputError("The file x is missing."), "The file x is missing."), (ValueError("odd"), "fault")]
)
def test_a_failing_action_is_shown_and_the_loop_lives_on(error, text):
    store = Store(fresh())
    for action in (Count(), Fail(error), Count()):
        store.dispatch(action)
    store.step()
    assert store.state.frame == 2
    assert store.state.notice is not None
    assert text in store.state.notice.text


def test_a_failing_effect_is_shown():
    store = Store(fresh())

    def full_disk(before, after):
        raise OSError("no space left")

    store.add_effect(full_disk)
    store.dispatch(Count())
    store.step()
    assert store.state.notice is not None
    assert "no space left" in store.state.notice.text


def test_layers_hide_one_by_one():
    layers = LayerSettings().with_visible(Layer.SCAN, False)
    assert not layers.is_visible(Layer.SCAN)
    assert layers.is_visible(Layer.POINTS)
    assert layers.with_visible(Layer.SCAN, True) == LayerSettings()
