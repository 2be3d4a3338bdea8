"""Any action that people, jobs or the app itself may dispatch, as hypothesis makes them; each class of actions/."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from gazeloc_app.actions.action import Notify
from gazeloc_app.actions.choices import ChooseAlignment, ChooseMethod, CompareMethod, OpenRecording
from gazeloc_app.actions.files import ImportKeypoints
from gazeloc_app.actions.history import GoToStep, Redo, Undo
from gazeloc_app.actions.jobs import (
    CancelJob,
    DismissJobs,
    JobEnded,
    JobProgressed,
    OfferJobs,
    ResumeJobs,
    StartJob,
)
from gazeloc_app.actions.live import FitFound, FollowKeypoints
from gazeloc_app.actions.marks import MarkFrame, NoteFrame
from gazeloc_app.actions.pairs import DeletePair, EnablePair, RenamePair, SelectPair
from gazeloc_app.actions.people import PersonCame, PersonLeft
from gazeloc_app.actions.picks import MovePoint, PickPoint, PickSighting, Side
from gazeloc_app.actions.places import RemoveView, RenameView, SaveView
from gazeloc_app.actions.playing import SPEEDS, Play, PlayOn, SetSpeed, TogglePlay
from gazeloc_app.actions.suggest import ShowSuggestions
from gazeloc_app.actions.views import (
    BeginAt,
    ColorCameras,
    CompareWith,
    DrawTags,
    NameRenderer,
    ScanPrepared,
    ShowFrame,
    ShowLayer,
    StepFrame,
    ThinCameras,
    TintLayer,
    UseSafeColors,
)
from gazeloc_app.annotation.history import History
from gazeloc_app.state import Coloring, Job, Layer, Level
from gazeloc_app.work import tasks
from hypothesis import strategies as st

from gazeloc_core.frames.marks import Mark
from gazeloc_core.keypoints import KeypointPair, KeypointSet, Sighting
from gazeloc_core.methods import Method
from gazeloc_core.surfaces.saved_views import SavedView

RECORDINGS = ("walk", "sit")
DESK, DOOR = SavedView("desk", (1, 2, 3), (0, 0, 1)), SavedView("door", (3, 2, 1), (0, 0, 1))
IMPORTED = KeypointSet((KeypointPair("k1", "from a file", (1.0, 2.0, 3.0), (0.1, 0.2, 0.3)),))
_keys = st.sampled_from(["k1", "k2", "k3"])
_points = st.tuples(*[st.floats(-5, 5)] * 3)
_sightings = st.builds(Sighting, st.integers(0, 5), st.floats(0, 100), st.floats(0, 100))
_alignments = st.none() | st.sampled_from(["a", "b", "c"])
_names = st.sampled_from(["desk", "door", "bed", "столик 🛏", "b" * 60])
_works = st.sampled_from([(("recording", name),) for name in RECORDINGS])


def actions(open_history: Callable[[str], History]) -> st.SearchStrategy[Any]:
    """Any action; `open_history(recording)` is what opening another recording asks for."""
    decided = [
        st.builds(PickPoint, st.sampled_from(Side), _points, st.booleans(), st.sampled_from(["", "tag 3"])),
        st.builds(MovePoint, _keys, _points, st.sampled_from(Side)),
        st.builds(PickSighting, _sightings, st.none() | _keys, st.none() | _points, side=st.sampled_from(Side)),
        st.builds(RenamePair, _keys, st.text(max_size=90)),
        st.builds(EnablePair, _keys, st.booleans()),
        st.builds(DeletePair, _keys),
        st.just(ImportKeypoints(IMPORTED, "list.csv")),
        st.builds(ChooseAlignment, _alignments),
        st.builds(ChooseMethod, st.sampled_from(Method)),
        st.builds(CompareMethod, st.sampled_from(Method), st.booleans()),
        st.builds(CompareWith, st.sampled_from(["", "a", "tags"])),
        st.builds(FollowKeypoints, st.booleans()),
        st.builds(MarkFrame, st.sampled_from(Mark)),
        st.builds(NoteFrame, st.integers(0, 3), st.text(max_size=5)),
        st.builds(SaveView, st.sampled_from([DESK, DOOR])),
        st.builds(RenameView, _names, _names),
        st.builds(RemoveView, _names),
        st.builds(ShowLayer, st.sampled_from(Layer), st.booleans()),
        st.builds(TintLayer, st.sampled_from(Layer), st.none() | st.just((9, 8, 7)), st.integers(0, 2)),
        st.builds(ThinCameras, st.none() | st.integers(-2, 200), st.integers(0, 2)),
        st.builds(ColorCameras, st.sampled_from(Coloring)),
        st.builds(DrawTags, st.booleans()),
        st.builds(ShowSuggestions, st.booleans()),
    ]
    ended = [
        st.builds(JobEnded, st.sampled_from(Level), st.just("It ended."), _alignments, st.booleans()),
        st.builds(FitFound, st.sampled_from(RECORDINGS), st.just(KeypointSet()), _alignments, is_step=st.booleans()),
    ]
    through = [st.builds(Undo), st.builds(Redo), st.builds(GoToStep, st.integers(0, 5), st.integers(0, 5))]
    return st.one_of([*decided, *ended, *through * 3, *_others(open_history)])


def _others(open_history: Callable[[str], History]) -> list[st.SearchStrategy[Any]]:
    return [
        st.builds(
            lambda name: OpenRecording(name, lambda: open_history(name)),
            st.sampled_from(RECORDINGS),
        ),
        st.builds(ShowFrame, st.integers(-3, 9)),
        st.builds(StepFrame, st.integers(-3, 3), st.just(9)),
        st.builds(BeginAt, st.integers(0, 9)),
        st.builds(Play, st.booleans()),
        st.builds(TogglePlay),
        st.builds(SetSpeed, st.sampled_from([*SPEEDS, 3.0])),
        st.builds(PlayOn, st.sampled_from(RECORDINGS), st.integers(0, 9)),
        st.builds(SelectPair, st.none() | _keys),
        st.builds(UseSafeColors, st.booleans()),
        st.builds(Notify, st.sampled_from(Level), st.text(max_size=9)),
        st.builds(NameRenderer, st.text(max_size=9)),
        st.builds(ScanPrepared),
        st.builds(StartJob, st.sampled_from(["Align", "Refine"]), st.just(tasks.align), _works),
        st.builds(JobProgressed, st.floats(0, 1), st.text(max_size=9)),
        st.builds(CancelJob, st.integers(0, 5)),
        st.builds(OfferJobs, st.just((Job("Align", tasks.align, (("recording", "sit"),)),))),
        st.builds(ResumeJobs),
        st.builds(DismissJobs),
        st.builds(PersonCame, st.integers(0, 5), st.text(max_size=50)),
        st.builds(PersonLeft, st.integers(0, 5)),
    ]
