"""What the stages made, read for the views: typed, or None where it is not there yet; read again when it changed."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform

from gazeloc_app.memory import Memory
from gazeloc_app.state import Annotation
from gazeloc_core.alignment.alignment import Alignment
from gazeloc_core.alignment.paper_keypoints import SfmTagCenters, sfm_tag_centers
from gazeloc_core.arrays import Floats, Ints
from gazeloc_core.camera import Camera
from gazeloc_core.charts.chart_file import read_charts
from gazeloc_core.charts.values import Drawing
from gazeloc_core.errors import GazelocError
from gazeloc_core.evaluation.evaluate import evaluate, match_times
from gazeloc_core.evaluation.truth import read_tum
from gazeloc_core.localize.sfm import localize_sfm
from gazeloc_core.methods import Method
from gazeloc_core.project import Project
from gazeloc_core.recording import Recording
from gazeloc_core.scan import Mesh, RoomScan
from gazeloc_core.sfm_model import PlacedModel, SfmModel, TrackedFrames
from gazeloc_core.stages import inputs, registration
from gazeloc_core.stages.pieces import placed_pieces
from gazeloc_core.stages.recording import load_keyframes
from gazeloc_core.stages.scores import FORMULA, FrameScores, load_scores
from gazeloc_core.stages.tracking import load_tracked
from gazeloc_core.storage.artifacts import Artifact
from gazeloc_core.storage.files import read_json
from gazeloc_core.surfaces.raycast import Raycaster
from gazeloc_core.tag_types import TagCorners, TagSightings
from gazeloc_core.trajectory import Trajectory

T = TypeVar("T")
FACES_PER_TREE = 50_000
_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class FrameErrors:
    """Errors of all N frames against the ground truth, NaN where there is no pose or no truth."""

    position_m: Floats
    rotation_deg: Floats


class ProjectData:
    """Reads of one project, remembered by content. Safe to use from several threads (see `Memory`).

    What a stage made may be damaged: then it is as if it were not there, and `say` is told the sentence, once.
    """

    def __init__(self, project: Project, say: Callable[[str], None] = _log.warning):
        self.project = project
        self._say = say
        self._said: set[str] = set()
        self._remember = Memory().of
        self._lock = threading.Lock()
        """Of what follows; never held while something is read."""
        self._slots: dict[str, list[tuple[int, str | None]]] = {}

    def scan(self) -> RoomScan:
        """The scan as its file has it."""
        return self._remember("scan", None, lambda: inputs.load_scan(self.project))

    def mesh(self) -> Mesh:
        """The scan's mesh with its colours, taken from the frames where the file has none."""
        colored = self._read("mesh", self.project.scan_artifact("colors"), lambda: inputs.load_mesh(self.project))
        return colored or self.scan().mesh

    @property
    def scan_revision(self) -> str:
        """Tells the scan with the colours that it has now from the one without."""
        stamp = self.project.scan_artifact("colors").result_stamp
        return "0" if stamp is None else f"{stamp[0]:x}"

    def raycaster(self) -> Raycaster:
        """Single rays against the scan's mesh, prepared without holding Python's GIL for long."""
        return self._remember("raycaster", None, lambda: Raycaster(self.scan().mesh, FACES_PER_TREE))

    def scan_tags(self) -> TagCorners | None:
        """Tag corners on the scan."""
        artifact = self.project.scan_artifact("corners")
        return self._read("scan tags", artifact, lambda: inputs.load_corners(artifact.read_arrays()))

    def sfm_tags(self, recording: str) -> TagCorners | None:
        """Tag corners in the reconstruction."""
        artifact = self.project.artifact(recording, "corners")
        return self._read(f"{recording} tags", artifact, lambda: inputs.load_corners(artifact.read_arrays()))

    def seen_tags(self, recording: str | None) -> TagSightings | None:
        """The tags that were found in a recording's undistorted frames, or (None) in `scan.frames_with_images`."""
        artifact = self.project.scan_artifact("tags") if recording is None else self.project.artifact(recording, "tags")
        load = lambda: inputs.load_sightings(artifact.read_arrays())  # noqa: E731
        return self._read("seen tags" if recording is None else f"{recording} seen tags", artifact, load)

    def recording(self, recording: str) -> Recording:
        """The recording as its files have it."""
        return self._remember(f"{recording} files", None, lambda: inputs.load_recording(self.project, recording))

    def camera(self, recording: str) -> Camera | None:
        """The pinhole camera of the undistorted frames."""
        artifact = self.project.artifact(recording, "undistorted")
        load = lambda: inputs.load_undistorted_camera(self.project, recording)  # noqa: E731
        return self._read(f"{recording} camera", artifact, load)

    def model(self, recording: str) -> SfmModel | None:
        """The reconstruction."""
        artifact = inputs.sfm_models(self.project, recording)
        return self._read(
            f"{recording} {artifact.stage} model", artifact, lambda: inputs.load_sfm_model(self.project, recording)
        )

    def keyframes(self, recording: str) -> Ints | None:
        """The frames that were to be registered."""
        artifact = self.project.artifact(recording, "keyframes")
        return self._read(f"{recording} keyframes", artifact, lambda: load_keyframes(self.project, recording))

    def alignment(self, recording: str, key: str | None) -> Alignment | None:
        """An alignment by its key; None for none, or where its file is damaged."""
        if key is None:
            return None
        load = lambda: registration.load_alignment(self.project, recording, key)  # noqa: E731
        return self._remember_or_say(f"{recording} alignment {key}", key, load)

    def alignments(self, recording: str) -> list[Alignment]:
        """All alignments of a recording, the oldest first; damaged files are left out."""
        folder = self.project.alignments_folder(recording)
        files = sorted(folder.glob("*.json"), key=lambda path: (path.stat().st_mtime_ns, path.name))
        found = (self.alignment(recording, path.stem) for path in files)
        return [alignment for alignment in found if alignment is not None]

    def refinement(self, recording: str) -> dict[str, Any] | None:
        """What the last refinement found, as `Refinement.to_json` wrote it."""
        artifact = self.project.artifact(recording, "refinement")
        load: Callable[[], dict[str, Any]] = lambda: read_json(  # noqa: E731
            artifact.folder / "refinement.json", "a refinement"
        )
        return self._read(f"{recording} refinement", artifact, load)

    def poses_key(self, recording: str, annotation: Annotation, method: Method | None = None) -> str | None:
        """Names the poses of a method, by default of the one that is shown; None where there are none.

        Those of `sfm` are named by the alignment's key, those of others by `method@revision`.
        """
        method = method or annotation.method
        if method is Method.SFM:
            return annotation.alignment
        stamp = self.project.result(recording, method, "trajectory").result_stamp
        return None if stamp is None else f"{method}@{stamp[0]:x}-{stamp[1]:x}"

    def trajectory(self, recording: str, key: str | None) -> Trajectory | None:
        """The poses of a key (see `poses_key`), of a method's the newest.

        Those under an alignment are made here by the function of the stage itself, so that a choice shows at once.
        """
        if key is None or "@" not in key:
            return self._aligned_trajectory(recording, key)
        method = method_of(key)
        artifact = self.project.result(recording, method, "trajectory")
        return self._read(f"{recording} {method}", artifact, lambda: inputs.load_trajectory(artifact.read_arrays()))

    def _aligned_trajectory(self, recording: str, key: str | None) -> Trajectory | None:
        alignment, model, keyframes = self.alignment(recording, key), self.model(recording), self.keyframes(recording)
        if alignment is None or model is None or keyframes is None:
            return None
        times = self.recording(recording).timestamp_ns
        placed = [PlacedModel(model, alignment.scan_from_sfm, self.tracked(recording)), *self.pieces(recording)]
        load = lambda: localize_sfm(times, keyframes, placed)  # noqa: E731
        made_of = (self.project.artifact(recording, stage).result_stamp for stage in ("keyframes", "pieces"))
        content = (key, model, *made_of, placed[0].tracked)
        return self._remember_or_say(f"{recording} trajectory {self._slot(recording, key)}", content, load)

    def _slot(self, recording: str, key: str | None) -> int:
        """Where poses are remembered: two alignments are looked at in turns, with a third the older one goes."""
        with self._lock:
            kept = self._slots.setdefault(recording, [(0, None), (1, None)])
            slot = next((slot for slot, other in kept if other == key), kept[0][0])
            self._slots[recording] = [*(item for item in kept if item[0] != slot), (slot, key)]
            return slot

    def tracked(self, recording: str) -> TrackedFrames | None:
        """The frames tracked between the reconstruction's images."""
        artifact = self.project.artifact(recording, "tracking")
        content = (artifact.result_stamp, inputs.sfm_models(self.project, recording).result_stamp)
        return self._remember_or_say(f"{recording} tracked", content, lambda: load_tracked(self.project, recording))

    def pieces(self, recording: str) -> list[PlacedModel]:
        """The smaller pieces of the reconstruction that have a place in the scan."""
        artifact = self.project.artifact(recording, "pieces")
        return self._read(f"{recording} pieces", artifact, lambda: placed_pieces(self.project, recording)) or []

    def anchoring_reason(self, recording: str) -> str:
        """Whether the reconstruction was bent to the tags, and why; "" before that was tried."""
        artifact = self.project.artifact(recording, "anchoring")
        notes = self._read(f"{recording} anchoring reason", artifact, lambda: artifact.header().notes)
        return " ".join(notes or ())

    def piece_reasons(self, recording: str) -> tuple[str, ...]:
        """Why each smaller piece of the reconstruction has a place in the scan, or none."""
        artifact = self.project.artifact(recording, "pieces")
        return self._read(f"{recording} piece reasons", artifact, lambda: artifact.header().notes) or ()

    def tag_columns(self, recording: str, method: Method) -> dict[str, NDArray[Any]] | None:
        """What each pose of a method of tags rests on, columns over the frames (see `stages.tags`); None for others."""
        artifact = self.project.result(recording, method, "trajectory")
        columns = self._read(f"{recording} {method} columns", artifact, artifact.read_arrays)
        return columns if columns is not None and "tags_used" in columns else None

    def truth(self, recording: str) -> tuple[Ints, RigidTransform] | None:
        """The ground truth: times and `scan_from_camera`."""
        if not recording:
            return None
        entry = self._remember(f"{recording} entry", None, lambda: self.project.recording(recording))
        path = entry.truth
        return None if path is None else self._remember_or_say(f"{recording} truth", None, lambda: read_tum(path))

    def true_keyframes(self, recording: str) -> RigidTransform | None:
        """The ground truth of the keyframes; of all its times while there are no keyframes, None without a truth."""
        truth, keyframes = self.truth(recording), self.keyframes(recording)
        if truth is None or keyframes is None:
            return None if truth is None else truth[1]
        times, poses = truth
        wanted = self.recording(recording).timestamp_ns[keyframes]

        def load() -> RigidTransform | None:
            rows = match_times(wanted, times)
            return poses[rows[rows >= 0]] if (rows >= 0).any() else None

        return self._remember(
            f"{recording} true keyframes", self.project.artifact(recording, "keyframes").result_stamp, load
        )

    def errors(self, recording: str, key: str | None) -> FrameErrors | None:
        """The errors of poses (see `poses_key`) against the ground truth, by frame; None without either."""
        trajectory, truth = self.trajectory(recording, key), self.truth(recording)
        if trajectory is None or truth is None:
            return None
        return self._remember_or_say(
            f"{recording} errors {method_of(key)}", trajectory, lambda: _frame_errors(trajectory, truth)
        )

    def frame_scores(self, recording: str, key: str | None) -> FrameScores | None:
        """How well the frames agree with the scan by the poses of a key; None where these were not scored."""
        if key is None:
            return None
        method = method_of(key)
        poses, artifact = (self.project.result(recording, method, stage) for stage in ("trajectory", "scores"))
        stamp, count = artifact.result_stamp, len(self.recording(recording))
        if stamp is None:
            return None

        def load() -> FrameScores | None:
            trajectory = poses.header()
            of_these = method is not Method.SFM or trajectory.inputs.get("alignment") == key
            made_of = artifact.header().inputs
            is_current = made_of.get("trajectory") == trajectory.content and made_of.get("formula") == FORMULA
            return load_scores(artifact, count) if of_these and is_current else None

        return self._remember_or_say(f"{recording} {method} scores", (stamp, poses.result_stamp, key), load)

    def scores(self, recording: str, key: str | None) -> Floats:
        """The agreement (N,) of all frames by the poses of a key, 0 to 1, NaN where there is none."""
        found = self.frame_scores(recording, key)
        return np.full(len(self.recording(recording)), np.nan) if found is None else found.score

    def figures(self, recording: str) -> tuple[dict[str, Drawing], tuple[str, ...]] | None:
        """The charts that were drawn for a recording, and why others are missing; None before any were drawn."""
        found = [self._charts(recording, stage) for stage in ("figures", "advice")]
        drawn = [one for one in found if one is not None]
        if not drawn:
            return None
        return {name: chart for charts, _ in drawn for name, chart in charts.items()}, drawn[0][1]

    def _charts(self, recording: str, stage: str) -> tuple[dict[str, Drawing], tuple[str, ...]] | None:
        artifact = self.project.artifact(recording, stage)
        return self._read(f"{recording} {stage}", artifact, lambda: read_charts(artifact))

    def tag_points(self, recording: str) -> SfmTagCenters | None:
        """The reconstruction's points under tags (figure 9); None without tags or a reconstruction."""
        model, camera = self.model(recording), self.camera(recording)
        artifact = self.project.artifact(recording, "tags")
        stamp = artifact.result_stamp
        if model is None or camera is None or stamp is None:
            return None
        load = lambda: sfm_tag_centers(  # noqa: E731
            model, camera, inputs.load_sightings(artifact.read_arrays())
        )
        return self._remember_or_say(f"{recording} tag points", (stamp, model), load)

    def _read(self, name: str, artifact: Artifact, load: Callable[[], T]) -> T | None:
        """What `load` reads of an artifact; None where it is not there or damaged."""
        stamp = artifact.result_stamp
        return None if stamp is None else self._remember_or_say(name, stamp, load)

    def _remember_or_say(self, name: str, content: object, load: Callable[[], T]) -> T | None:
        """`_remember`, where a failure is remembered as None and its sentence said."""

        def load_or_say() -> T | None:
            try:
                return load()
            except GazelocError as error:
                self._say_once(str(error))
                return None

        return self._remember(name, content, load_or_say)

    def _say_once(self, sentence: str) -> None:
        with self._lock:
            is_new = sentence not in self._said
            self._said.add(sentence)
        if is_new:
            self._say(sentence)


def method_of(key: str | None) -> Method:
    """The method whose poses a key names (see `ProjectData.poses_key`)."""
    return Method(key.partition("@")[0]) if key is not None and "@" in key else Method.SFM


def _frame_errors(trajectory: Trajectory, truth: tuple[Ints, RigidTransform]) -> FrameErrors:
    evaluation = evaluate(trajectory, *truth)
    position, rotation = np.full(len(trajectory), np.nan), np.full(len(trajectory), np.nan)
    position[evaluation.frame_index] = evaluation.frame_position_m
    rotation[evaluation.frame_index] = evaluation.frame_rotation_deg
    return FrameErrors(position, rotation)
