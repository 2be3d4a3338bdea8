"""What the app knows, in one frozen value: every view renders from it, and only actions (actions/) change it.

Not in here: what belongs to one browser (its camera, its pick mode), which stays on the client's handle; and what the
stages made (meshes, points, trajectories), which is read from the project by `data.py` and named here by revision.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any

from gazeloc_app import palette
from gazeloc_core.frames.marks import FrameMarks
from gazeloc_core.keypoints import KeypointSet
from gazeloc_core.methods import Method
from gazeloc_core.surfaces.glb import Rgb
from gazeloc_core.surfaces.saved_views import SavedView


class Layer(StrEnum):
    """What can be shown and hidden in the scene."""

    SCAN = "Scan"
    POINTS = "Reconstruction"
    SCAN_TAGS = "Scan's tags"
    SFM_TAGS = "Glasses' tags"
    PHONE = "Phone"
    TRUTH = "Ground truth"
    ESTIMATE = "Estimate"
    KEYPOINTS = "Keypoints"
    TAG_POINTS = "Points under tags"
    GAZE = "Gaze"
    ERRORS = "Errors"
    GRID = "Grid"
    PEOPLE = "People"


class Coloring(StrEnum):
    """What the colours of the recording's cameras stand for."""

    SET = "method"
    STATUS = "status"
    ERROR = "error"
    SCORE = "agreement"


class Level(StrEnum):
    """How much a notice matters."""

    INFO = "info"
    WARNING = "warning"
    ERROR = "error"


@dataclass(frozen=True)
class Notice:
    """A sentence for the user, shown until the next one."""

    level: Level
    text: str


@dataclass(frozen=True)
class Job:
    """Long work outside of the app's process, under way or asked for: `task` (see tasks.py) with its keywords."""

    name: str
    task: Callable[..., Any]
    keywords: tuple[tuple[str, Any], ...] = ()
    fraction: float = 0.0
    text: str = ""
    remaining: str = ""
    """How much longer it takes, in words; "" while nobody can tell."""
    log: tuple[str, ...] = ()
    """The last lines of its log."""
    is_cancelling: bool = False
    number: int = 0
    """Counts the jobs of a session, so that one can be told from the next of the same name."""

    @property
    def recording(self) -> str | None:
        """The recording that it is about, None for the scan."""
        return dict(self.keywords).get("recording")

    def is_same_work(self, other: Job) -> bool:
        """Whether the other does the very same."""
        return (self.task, self.keywords) == (other.task, other.keywords)


@dataclass(frozen=True)
class EndedJob:
    """What became of long work: its last sentence and the last lines of its log."""

    name: str
    notice: Notice
    log: tuple[str, ...]
    number: int
    recording: str | None = None


@dataclass(frozen=True)
class Person:
    """Somebody whose page is open; `number` is the lowest that was free and gives the colour."""

    client_id: int
    number: int
    name: str = ""

    @property
    def title(self) -> str:
        """The name, or what stands in for it."""
        return self.name or f"Person {self.number}"


@dataclass(frozen=True)
class LayerSettings:
    """Which layers show, how, and what shows beside them: one scene for all browsers, so decided together."""

    hidden: frozenset[Layer] = frozenset({Layer.TAG_POINTS, Layer.ERRORS, Layer.GRID})
    coloring: Coloring = Coloring.SET
    thinning: int | None = None
    """Every how many of the recording's cameras one is drawn; None leaves it to their number."""
    compared: frozenset[Method] = frozenset()
    """Methods whose poses show in the scene beside those of the method that was chosen."""
    draws_tags: bool = False
    """Whether the tags that were found are drawn into the frame."""
    suggests: bool = True
    """Whether the next best place for a keypoint is shown."""

    def is_visible(self, layer: Layer) -> bool:
        """Whether a layer shows."""
        return layer not in self.hidden

    def with_visible(self, layer: Layer, is_visible: bool) -> LayerSettings:
        """With one layer shown or hidden."""
        return replace(self, hidden=self.hidden - {layer} if is_visible else self.hidden | {layer})


@dataclass(frozen=True)
class Annotation:
    """What people decide, and what undo and redo step through."""

    keypoints: KeypointSet = field(default_factory=KeypointSet)
    alignment: str | None = None
    """The key of the alignment in force; None before the first."""
    alignment_by_person: bool = False
    method: Method = Method.SFM
    """Whose poses are shown and exported."""
    marks: FrameMarks = field(default_factory=FrameMarks)
    """What people think of frames' poses."""
    views: tuple[SavedView, ...] = ()
    """Places to look at the room from; about the room, so the same in all recordings."""
    tints: tuple[tuple[Layer, Rgb], ...] = ()
    """Layers' colours in place of their own; the same in all recordings."""
    layers: LayerSettings = field(default_factory=LayerSettings)
    """What shows in the scene; the same in all recordings."""
    is_live: bool = True
    """Whether people want the alignment to follow the keypoints (see `live_alignment.is_following`)."""
    compared_with: str = ""
    """Whose render shows beside that of the poses that are shown: an alignment's key, a method, or "" for none."""

    def tint(self, layer: Layer) -> Rgb | None:
        """A layer's tint, None for its own colours."""
        return dict(self.tints).get(layer)

    def with_tint(self, layer: Layer, tint: Rgb | None) -> Annotation:
        """With one layer's tint set or taken away."""
        others = tuple(item for item in self.tints if item[0] is not layer)
        return replace(self, tints=others if tint is None else (*others, (layer, tint)))

    def with_suggested(self, suggested: SuggestedAlignment) -> Annotation:
        """With an alignment that a job suggests; one of a run never replaces one that a person chose."""
        is_free = suggested.by_person or not self.alignment_by_person
        if not is_free or suggested.key == self.alignment:
            return self
        return replace(self, alignment=suggested.key, alignment_by_person=suggested.by_person)


@dataclass(frozen=True)
class SuggestedAlignment:
    """An alignment that a job suggests to put in force."""

    recording: str
    key: str
    by_person: bool


ABOUT_THE_ROOM = ("views", "tints", "layers")
"""The fields of `Annotation` that are the same in all recordings."""


MAX_UNDO = 500
Stroke = tuple[str, int]
"""What is pulled at, and a number that tells one pull from the next."""


@dataclass(frozen=True)
class AppState:
    """Everything that is the same in all browsers."""

    recordings: tuple[str, ...]
    recording: str
    """The one that is open; "" where the project has none."""
    annotation: Annotation = field(default_factory=Annotation)
    past: tuple[Annotation, ...] = ()
    future: tuple[Annotation, ...] = ()
    selected_key: str | None = None
    frame: int = 0
    are_colors_safe: bool = False
    """Whether the sets of cameras have the colours for colour-blind eyes."""
    live_asked: int = 0
    """Counts how often a person switched that on, which fits the keypoints at once."""
    fit_note: str = ""
    """Why the last change of the keypoints gave no alignment; "" where it did."""
    stroke: tuple[Stroke, Annotation] | None = None
    """The last pull at a widget, and what it led to: it goes on as the same step while nothing else happens."""
    is_playing: bool = False
    speed: float = 1.0
    """How many seconds of the recording pass in a second of playing."""
    job: Job | None = None
    waiting_jobs: tuple[Job, ...] = ()
    """Asked for while `job` runs; they follow one after the other."""
    ended_jobs: tuple[EndedJob, ...] = ()
    """The last ones of this session, the newest first."""
    offered_jobs: tuple[Job, ...] = ()
    """What was under way when GazeLoc ended the last time; begun only when somebody says so."""
    suggested: tuple[SuggestedAlignment, ...] = ()
    """By jobs about recordings that are not open: a step of theirs, on the disk already (annotation/saving.py)."""
    jobs_started: int = 0
    people: tuple[Person, ...] = ()
    """Who is here, by number."""
    notice: Notice | None = None
    data_revision: int = 0
    """Counts up whenever a stage finished, so that views read its artifacts anew."""
    renderer_note: str = ""
    """What to say about the renderer of pictures where it stands in for the usual one."""

    @property
    def layers(self) -> LayerSettings:
        """What shows in the scene."""
        return self.annotation.layers

    @property
    def cameras(self) -> palette.Cameras:
        """The colours of the sets of cameras."""
        return palette.cameras(are_safe=self.are_colors_safe)

    @property
    def jobs(self) -> tuple[Job, ...]:
        """What runs, then what waits."""
        return (() if self.job is None else (self.job,)) + self.waiting_jobs

    def has_job(self, name: str) -> bool:
        """Whether long work of this name runs or waits, about the recording that is open or about the scan."""
        return any(job.name == name and job.recording in (None, self.recording) for job in self.jobs)

    def job_title(self, job: Job | EndedJob) -> str:
        """A job's name, with its recording where that is not the one that is open."""
        return job.name if job.recording in (None, self.recording) else f"{job.name} ({job.recording})"

    def annotate(self, annotation: Annotation) -> AppState:
        """With a new annotation that can be undone; the redo list is cut, as everywhere."""
        if annotation == self.annotation:
            return self
        return replace(self, annotation=annotation, past=(*self.past, self.annotation)[-MAX_UNDO:], future=())

    def annotate_in_stroke(self, annotation: Annotation, stroke: Stroke) -> AppState:
        """`annotate`, where all values of one pull at a widget are one step; number 0 is a step of its own."""
        goes_on = self.stroke is not None and self.stroke[0] == stroke and self.stroke[1] is self.annotation
        if goes_on and stroke[1]:
            return replace(self, annotation=annotation, stroke=(stroke, annotation))
        state = self.annotate(annotation)
        return replace(state, stroke=(stroke, state.annotation)) if stroke[1] and state is not self else state

    def with_layers(self, **changes: Any) -> AppState:
        """`annotate` with only these fields of what shows changed."""
        return self.annotate(replace(self.annotation, layers=replace(self.layers, **changes)))

    def with_keypoints(self, keypoints: KeypointSet) -> AppState:
        """`annotate` with only the keypoints changed."""
        return self.annotate(replace(self.annotation, keypoints=keypoints))

    def noticed(self, level: Level, text: str) -> AppState:
        """With a sentence for the user."""
        return replace(self, notice=Notice(level, text))
