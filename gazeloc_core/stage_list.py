"""The method's stages as a list: what runs, what it depends on, and which methods need it.

scan       colors ─ tags ─ corners ───────────────────────────┐
recording  keyframes ─ undistorted ┬ tags ─────────┬ corners ─┴ alignment ─ refinement ─ trajectory ─ gaze
                                   └ reconstruction ┴ anchoring ─ tracking ───────────────┘   (of each method)
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

from gazeloc_core.methods import Method
from gazeloc_core.progress import Report
from gazeloc_core.project import Project
from gazeloc_core.stages import (
    anchoring,
    baselines,
    gaze,
    inputs,
    pieces,
    poses,
    recording,
    registration,
    scan,
    scores,
    tags,
    tracking,
)
from gazeloc_core.storage.artifacts import Artifact

Run = Callable[[Project, str, Report], object]
Inputs = Callable[[Project, str], Mapping[str, str]]
ALL = frozenset(Method)
WITH_TAGS = ALL - {Method.GLOBAL}
WITH_MODEL = frozenset(method for method in Method if method.has_model)


@dataclass(frozen=True, kw_only=True)
class Stage:
    """One stage: how it runs, what it depends on, who needs it, and its usual share of the time."""

    name: str
    title: str
    run: Run
    inputs: Inputs
    methods: frozenset[Method] = ALL
    """The methods that need it."""
    of_method: Method | None = None
    """The method whose own result it makes; None where methods share it."""
    of_scan: bool = False
    weight: float = 1.0
    is_needed: Callable[[Project], bool] = lambda _: True

    def artifact(self, project: Project, name: str) -> Artifact:
        """The place of its result."""
        if self.of_scan:
            return project.scan_artifact(self.name)
        if self.of_method is not None:
            return project.result(name, self.of_method, self.name)
        return project.artifact(name, self.name)


def _has_tags(project: Project) -> bool:
    return project.settings.tags is not None


def _needs_colors(project: Project) -> bool:
    return not inputs.load_scan(project).mesh.has_colors and bool(inputs.load_scan(project).frames_with_images)


SFM = frozenset({Method.SFM})
_SHARED: tuple[Stage, ...] = (
    Stage(
        name="colors",
        title="Colour the scan",
        of_scan=True,
        weight=4,
        run=lambda project, _, report: scan.color_scan(project, report),
        inputs=lambda project, _: scan.color_inputs(project),
        is_needed=_needs_colors,
    ),
    Stage(
        name="tags",
        title="Find tags in the phone's frames",
        methods=WITH_TAGS,
        of_scan=True,
        weight=4,
        run=lambda project, _, report: scan.detect_scan_tags(project, report=report),
        inputs=lambda project, _: scan.tag_inputs(project),
        is_needed=_has_tags,
    ),
    Stage(
        name="corners",
        title="Put tags on the scan",
        methods=frozenset({Method.SFM, Method.TAGS}),
        of_scan=True,
        run=lambda project, _, report: scan.map_tags(project, report=report),
        inputs=lambda project, _: scan.corner_inputs(project),
        is_needed=_has_tags,
    ),
    Stage(
        name="keyframes",
        title="Choose keyframes",
        weight=10,
        run=lambda project, name, report: recording.find_keyframes(project, name, report=report),
        inputs=recording.keyframe_inputs,
    ),
    Stage(
        name="undistorted",
        title="Undistort keyframes",
        weight=4,
        run=lambda project, name, report: recording.undistort(project, name, report=report),
        inputs=recording.undistort_inputs,
    ),
    Stage(
        name="tags",
        title="Find tags in the glasses' frames",
        weight=30,
        run=lambda project, name, report: recording.detect_recording_tags(project, name, report=report),
        inputs=recording.tag_inputs,
        is_needed=_has_tags,
    ),
    Stage(
        name="reconstruction",
        title="Reconstruct the keyframes",
        methods=WITH_MODEL,
        weight=100,
        run=lambda project, name, report: recording.reconstruct_keyframes(project, name, report=report),
        inputs=recording.reconstruction_inputs,
    ),
    Stage(
        name="anchoring",
        title="Bend the reconstruction to the tags",
        methods=SFM,
        weight=10,
        run=lambda project, name, report: anchoring.anchor_reconstruction(project, name, report=report),
        inputs=anchoring.anchoring_inputs,
        is_needed=_has_tags,
    ),
    Stage(
        name="corners",
        title="Triangulate tags",
        methods=SFM,
        run=lambda project, name, report: recording.triangulate_tags(project, name, report=report),
        inputs=recording.corner_inputs,
        is_needed=_has_tags,
    ),
    Stage(
        name="tracking",
        title="Track the frames between keyframes",
        methods=SFM,
        weight=15,
        run=lambda project, name, report: tracking.track_between(project, name, report=report),
        inputs=tracking.tracking_inputs,
        is_needed=lambda project: project.settings.track_frames,
    ),
    Stage(
        name="alignment",
        title="Align to the scan",
        methods=SFM,
        weight=2,
        run=lambda project, name, report: registration.align_keypoints(project, name, report=report),
        inputs=registration.alignment_inputs,
    ),
    Stage(
        name="refinement",
        title="Refine with ICP",
        methods=SFM,
        weight=10,
        run=lambda project, name, report: registration.refine_alignment(project, name, report=report),
        inputs=registration.refinement_inputs,
    ),
    Stage(
        name="pieces",
        title="Align smaller pieces",
        methods=SFM,
        run=lambda project, name, report: pieces.align_pieces(project, name, report=report),
        inputs=pieces.piece_inputs,
    ),
)


def _alignment(method: Method, title: str, align: Run, depends: Inputs) -> Stage:
    return Stage(
        name="alignment",
        title=title,
        methods=frozenset({method}),
        of_method=method,
        weight=20,
        run=align,
        inputs=depends,
    )


def _poses_and_gaze(method: Method, place: Run, depends: Inputs) -> tuple[Stage, ...]:
    return (
        Stage(
            name="trajectory",
            title="Put the poses into the scan",
            methods=frozenset({method}),
            of_method=method,
            run=place,
            inputs=depends,
        ),
        Stage(
            name="gaze",
            title="Cast gaze into the scan",
            methods=frozenset({method}),
            of_method=method,
            weight=2,
            run=lambda project, name, report: gaze.cast_gaze_rays(project, name, method, report=report),
            inputs=partial(gaze.gaze_inputs, method=method),
        ),
    )


def _poses_by_alignment(method: Method) -> tuple[Stage, ...]:
    return _poses_and_gaze(
        method,
        lambda project, name, report: poses.place_by_method(project, name, method, report=report),
        partial(poses.method_inputs, method=method),
    )


def _score(project: Project, name: str, report: Report, *, method: Method) -> object:
    return scores.score_frames(project, name, method, report=report)


STAGES: tuple[Stage, ...] = (
    *_SHARED,
    *_poses_and_gaze(
        Method.SFM,
        lambda project, name, report: poses.place_sfm(project, name, report=report),
        poses.sfm_inputs,
    ),
    _alignment(
        Method.SFM_PAPER,
        "Align as in the paper",
        lambda project, name, report: baselines.align_sfm_paper(project, name, report=report),
        baselines.sfm_paper_inputs,
    ),
    _alignment(
        Method.GLOBAL,
        "Align by shape alone",
        lambda project, name, report: baselines.align_globally(project, name, report=report),
        baselines.global_inputs,
    ),
    *_poses_and_gaze(
        Method.TAGS,
        lambda project, name, report: tags.place_tags(project, name, report=report),
        tags.tags_inputs,
    ),
    *_poses_and_gaze(
        Method.TAGS_PAPER,
        lambda project, name, report: tags.place_tags_paper(project, name, report=report),
        tags.tags_paper_inputs,
    ),
    *_poses_by_alignment(Method.SFM_PAPER),
    *_poses_by_alignment(Method.GLOBAL),
)

SCORES: dict[Method, Stage] = {
    method: Stage(
        name="scores",
        title="Score the frames",
        methods=frozenset({method}),
        of_method=method,
        run=partial(_score, method=method),
        inputs=partial(scores.score_inputs, method=method),
    )
    for method in Method
}
"""Beside the method's stages: nothing depends on them, and they take as long as the recording is."""


def stage_named(name: str, *, of_scan: bool = False, method: Method = Method.SFM) -> Stage:
    """One stage of a method."""
    return next(
        stage for stage in STAGES if stage.name == name and stage.of_scan is of_scan and method in stage.methods
    )
