"""The history as lines: whatever people did, the lines give it back; and each step has a sentence."""

from dataclasses import fields, replace

import pytest
from gazeloc_app import state as state_module
from gazeloc_app.actions.choices import ChooseAlignment, ChooseMethod, CompareMethod
from gazeloc_app.actions.history import Redo, Undo
from gazeloc_app.actions.live import FollowKeypoints
from gazeloc_app.actions.marks import MarkFrame, NoteFrame
from gazeloc_app.actions.pairs import DeletePair, EnablePair, RenamePair
from gazeloc_app.actions.picks import PickPoint, PickSighting, Side
from gazeloc_app.actions.places import RemoveView, RenameView, SaveView
from gazeloc_app.actions.suggest import ShowSuggestions
from gazeloc_app.actions.views import ColorCameras, CompareWith, DrawTags, ShowLayer, ThinCameras, TintLayer
from gazeloc_app.annotation import history as history_module
from gazeloc_app.annotation.annotation_json import changed_from_json, changes_to_json
from gazeloc_app.annotation.history import History, all_lines, lines_between, read_lines
from gazeloc_app.annotation.steps import describe
from gazeloc_app.state import Annotation, AppState, Coloring, Layer, LayerSettings
from hypothesis import given, settings
from hypothesis import strategies as st

from gazeloc_core.errors import InputError
from gazeloc_core.frames.marks import FrameMark, FrameMarks, Mark
from gazeloc_core.keypoints import KeypointPair, KeypointSet, Sighting
from gazeloc_core.methods import Method
from gazeloc_core.surfaces.saved_views import SavedView

PAIR = KeypointPair(
    "k1", "corner", (1.0, 2.0, 3.0), (0.1, 0.2, 0.3), (Sighting(3, 10.5, 20.5),), 0.01, False, (Sighting(1, 2, 3),), 0.2
)
OTHER_VALUES = {  # of every field of Annotation; a new field needs one, and perhaps a codec in annotation_json
    "keypoints": KeypointSet((PAIR,)),
    "alignment": "abc",
    "alignment_by_person": True,
    "method": Method.TAGS,
    "marks": FrameMarks((FrameMark(3, Mark.BAD, "too far left"),)),
    "views": (SavedView("desk", (1.0, 2.0, 3.0), (0.0, 0.0, 1.0), 0.9),),
    "tints": ((Layer.SCAN, (1, 2, 3)), (Layer.TRUTH, (250, 0, 9))),
    "layers": LayerSettings(
        frozenset({Layer.SCAN, Layer.GRID}),
        Coloring.ERROR,
        7,
        frozenset({Method.TAGS}),
        draws_tags=True,
        suggests=False,
    ),
    "is_live": False,
    "compared_with": "tags",
}
DESK, DOOR = SavedView("desk", (1, 2, 3), (0, 0, 1)), SavedView("door", (3, 2, 1), (0, 0, 1))
COLORS = st.none() | st.tuples(*[st.integers(0, 255)] * 3)
actions = st.one_of(
    st.builds(PickPoint, st.sampled_from(Side), st.tuples(*[st.floats(-5, 5)] * 3), st.booleans()),
    st.builds(RenamePair, st.sampled_from(["k1", "k2"]), st.text(max_size=5)),
    st.builds(DeletePair, st.sampled_from(["k1", "k2"])),
    st.builds(ChooseAlignment, st.none() | st.sampled_from(["a", "b"])),
    st.builds(ChooseMethod, st.sampled_from(Method)),
    st.builds(MarkFrame, st.sampled_from(Mark)),
    st.builds(NoteFrame, st.integers(0, 3), st.text(max_size=5)),
    st.builds(SaveView, st.sampled_from([DESK, DOOR])),
    st.builds(RenameView, st.sampled_from(["desk", "door"]), st.sampled_from(["desk", "door", "bed"])),
    st.builds(RemoveView, st.sampled_from(["desk", "door"])),
    st.builds(TintLayer, st.sampled_from([Layer.SCAN, Layer.TRUTH]), COLORS, st.integers(0, 2)),
    st.builds(Undo),
    st.builds(Undo),
    st.builds(Redo),
)


def apply(state: AppState, *done) -> AppState:
    for action in done:
        state = action.apply(state)
    return state


@pytest.mark.parametrize("most", [500, 4])
@settings(max_examples=150)
@given(batches=st.lists(st.lists(actions, max_size=6), max_size=8))
def test_the_lines_give_back_what_people_did_whatever_falls_off_the_list(most, batches):
    with pytest.MonkeyPatch.context() as patched:
        for module in (state_module, history_module):
            patched.setattr(module, "MAX_UNDO", most)
        state = AppState(("walk",), "walk")
        lines = all_lines(History.of(state))
        for batch in batches:
            before, state = state, apply(state, *batch)
            lines += lines_between(History.of(before), History.of(state))
            assert read_lines(lines)[0] == History.of(state)
        assert read_lines(all_lines(History.of(state)))[0] == History.of(state)


def test_a_step_writes_only_what_it_changed():
    state = AppState(("walk",), "walk")
    clicked = PickPoint(Side.SCAN, (1, 2, 3)).apply(state)
    chosen = ChooseAlignment("abc").apply(clicked)
    (line,) = lines_between(History.of(clicked), History.of(chosen))
    assert line["step"] == {"alignment": "abc", "alignment_by_person": True, "is_live": False}
    assert lines_between(History.of(chosen), History.of(Undo().apply(chosen))) == [{"go": 1}]
    assert lines_between(History.of(chosen), History.of(chosen)) == []


@pytest.mark.parametrize("name", [field.name for field in fields(Annotation)])
def test_every_field_of_what_people_decide_survives_the_file(name):
    changed = replace(Annotation(), **{name: OTHER_VALUES[name]})
    assert changed_from_json(Annotation(), changes_to_json(Annotation(), changed)) == changed
    assert changed != Annotation()


@pytest.mark.parametrize(
    "lines",
    [
        [],
        [{"step": {}, "at": ""}],
        [{"start": {}, "format": "gazeloc-history", "version": 2}],
        [{"start": {}, "format": "gazeloc-history", "version": 1}, {"go": 1}],
        [{"start": {}, "format": "gazeloc-history", "version": 1}, {"go": "0"}],
        [{"start": {}, "format": "gazeloc-history", "version": 1}, {"step": {"who": 1}}],
        [{"start": {}, "format": "gazeloc-history", "version": 1}, {"step": {"keypoints": [{"key": "k1"}]}}],
        [{"start": {"method": "guess"}, "format": "gazeloc-history", "version": 1}],
        [{"start": {"tints": {"Scan": [1, 2]}}, "format": "gazeloc-history", "version": 1}],
        [{"start": {"tints": {"Moon": [1, 2, 3]}}, "format": "gazeloc-history", "version": 1}],
        [{"start": {"views": [{"name": "desk"}]}, "format": "gazeloc-history", "version": 1}],
        [{"start": []}],
        [7],
    ],
)
def test_garbled_lines_are_refused(lines):
    with pytest.raises(InputError):
        read_lines(lines)


@pytest.mark.parametrize(
    ("actions", "sentence"),
    [
        ([PickPoint(Side.SCAN, (1, 2, 3))], "Keypoint 1 placed on the scan"),
        ([PickPoint(Side.SFM, (1, 2, 3))], "Keypoint 1 placed in the reconstruction"),
        ([PickPoint(Side.SCAN, (1, 2, 3)), PickPoint(Side.SCAN, (1, 2, 4), move=True)], "Keypoint 1 moved on the scan"),
        ([PickSighting(Sighting(7, 1, 2))], "Keypoint 1 clicked in frame 7"),
        ([PickSighting(Sighting(7, 1, 2), side=Side.SCAN)], "Keypoint 1 clicked in the phone’s frame"),
        ([PickPoint(Side.SCAN, (1, 2, 3)), RenamePair("k1", "desk")], "Keypoint 1 renamed to desk"),
        ([PickPoint(Side.SCAN, (1, 2, 3)), EnablePair("k1", False)], "Keypoint 1 no longer counts"),
        ([PickPoint(Side.SCAN, (1, 2, 3)), DeletePair("k1")], "Keypoint 1 deleted"),
        ([ChooseAlignment("abc")], "Alignment abc put in force"),
        ([ChooseAlignment("abc"), ChooseAlignment(None)], "No alignment in force"),
        ([ChooseMethod(Method.TAGS)], "Method tags chosen"),
        ([SaveView(DESK)], "View “desk” saved"),
        ([SaveView(DESK), SaveView(replace(DESK, eye=(9, 9, 9)))], "View “desk” saved anew"),
        ([SaveView(DESK), RenameView("desk", "table")], "View “desk” renamed to “table”"),
        ([SaveView(DESK), SaveView(DOOR), RemoveView("desk")], "View “desk” removed"),
        ([ShowLayer(Layer.SCAN, False)], "Scan hidden"),
        ([ShowLayer(Layer.GRID, True)], "Grid shown"),
        ([ColorCameras(Coloring.ERROR)], "Cameras coloured by error"),
        ([ThinCameras(5)], "One camera in 5 drawn"),
        ([ThinCameras(5), ThinCameras(None)], "As many cameras drawn as fit"),
        ([CompareMethod(Method.TAGS, True)], "tags shown for comparison"),
        ([CompareMethod(Method.TAGS, True), CompareMethod(Method.TAGS, False)], "tags no longer compared"),
        ([CompareWith("tags")], "Renders compared with tags"),
        ([DrawTags(True)], "Tags drawn into frames"),
        ([ShowSuggestions(False)], "Next best place hidden"),
        ([FollowKeypoints(False)], "Alignment no longer follows the keypoints"),
        ([TintLayer(Layer.SCAN, (1, 2, 3))], "Colour of Scan changed"),
        ([TintLayer(Layer.SCAN, (1, 2, 3)), TintLayer(Layer.SCAN, None)], "Colour of Scan put back to its own"),
    ],
)
def test_each_step_has_its_sentence(actions, sentence):
    state = apply(AppState(("walk",), "walk"), *actions)
    assert describe(state.past[-1], state.annotation) == sentence


def test_many_changes_at_once_are_counted():
    many = KeypointSet(tuple(KeypointPair(f"k{i}", f"Keypoint {i}") for i in range(1, 5)))
    fewer = KeypointSet((replace(many.pairs[0], enabled=False), *many.pairs[2:]))
    assert describe(Annotation(), Annotation(many)) == "Keypoints: 4 added"
    assert describe(Annotation(many), Annotation(fewer)) == "Keypoints: 1 changed, 1 deleted"


def test_a_pull_at_the_colour_field_is_one_step_and_the_next_pull_another():
    state = AppState(("walk",), "walk")
    pulls = [TintLayer(Layer.SCAN, (n, 0, 0), stroke=1) for n in range(9)]
    after = apply(state, *pulls, TintLayer(Layer.SCAN, (0, 9, 0), stroke=2), TintLayer(Layer.SCAN, (0, 8, 0), stroke=2))
    assert [annotation.tint(Layer.SCAN) for annotation in after.past] == [None, (8, 0, 0)]
    assert after.annotation.tint(Layer.SCAN) == (0, 8, 0)
    assert apply(after, Undo()).annotation.tint(Layer.SCAN) == (8, 0, 0)
    late = TintLayer(Layer.SCAN, (7, 7, 7), stroke=2)
    assert len(apply(after, Undo(), late).past) == 2, "what comes after an undo is a step of its own"
    assert len(apply(after, PickPoint(Side.SCAN, (1, 2, 3)), late).past) == 4


def test_what_others_did_to_the_room_is_no_step_and_undo_goes_on_with_this_recordings_own():
    state = apply(
        AppState(("walk",), "walk"), PickPoint(Side.SCAN, (1, 2, 3)), SaveView(DESK), ChooseMethod(Method.TAGS)
    )
    state = apply(state, Undo())
    meanwhile = Annotation(views=(DESK, DOOR), tints=((Layer.SCAN, (1, 2, 3)),))
    history = History.of(state).with_room_of(meanwhile)
    assert (history.position, len(history.annotations)) == (2, 4)
    assert [len(annotation.views) for annotation in history.annotations] == [0, 0, 2, 2]
    assert {annotation.tints for annotation in history.annotations} == {meanwhile.tints}
    assert history.with_room_of(meanwhile) is history
    assert [annotation.keypoints for annotation in history.annotations] == [
        a.keypoints for a in History.of(state).annotations
    ]
