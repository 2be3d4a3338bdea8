"""Stage: how well every frame with a pose agrees with the render of the scan from it, by one method's poses.

Some hundred frames, evenly over the recording, are compared first: together they tell where the scan is off itself
(`scan_distortion`), and that is not held against any frame. Scoring a long recording takes minutes; what is done is
kept every few seconds, so that work that was cancelled or killed goes on where it was.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass

import numpy as np
from scipy.spatial.transform import RigidTransform

from gazeloc_core.arrays import Bools, Floats, Ints
from gazeloc_core.errors import ProjectError
from gazeloc_core.evaluation.agreement import AgreementOptions, FrameScorer
from gazeloc_core.evaluation.scan_distortion import ScanDistortion, scan_distortion
from gazeloc_core.methods import Method
from gazeloc_core.progress import Report, silent
from gazeloc_core.project import Project
from gazeloc_core.recording import Recording
from gazeloc_core.stages import inputs
from gazeloc_core.stages.begun_scores import COLUMNS, BegunScores
from gazeloc_core.storage.artifacts import Artifact, State
from gazeloc_core.storage.hashing import hash_of_value
from gazeloc_core.trajectory import Trajectory

FORMULA = "3"
"""Changes whenever the same frames get other scores or offsets."""
_COMPARED_FRAMES = 300


@dataclass(frozen=True, eq=False)
class FrameScores:
    """Of all N frames, NaN where there is no pose or nothing to compare, all but the score also where the offset cannot
    be told: see `agreement.Agreement`."""

    score: Floats
    offset_deg: Floats
    shift_m: Floats
    shift_sigma_m: Floats
    turn_deg: Floats
    turn_sigma_deg: Floats
    scan_shift_m: Floats

    @property
    def known(self) -> Floats:
        """The scores (K,) of the frames that have one."""
        return self.score[np.isfinite(self.score)]


def score_frames(
    project: Project,
    recording: str,
    method: Method = Method.SFM,
    options: AgreementOptions | None = None,
    report: Report = silent,
) -> FrameScores:
    """Score every frame that has a pose; what an interrupted run on the same inputs has done is not done again."""
    options = options or AgreementOptions()
    opened, depends = inputs.load_recording(project, recording), score_inputs(project, recording, method)
    trajectory = inputs.load_trajectory(project.result(recording, method, "trajectory").read_arrays())
    artifact = project.result(recording, method, "scores")
    path, key = artifact.folder.with_name("scores.begun.npz"), hash_of_value([depends, asdict(options)])
    begun = BegunScores(path, key, len(trajectory))
    run = _Run(opened, trajectory, FrameScorer(inputs.load_mesh(project), opened.camera, options), begun, report)
    try:
        distortion = run.compare()
        run.score_all(distortion)
    finally:
        begun.save()
    scores = FrameScores(**begun.columns())
    artifact.write_arrays(
        {**begun.columns(), **_distortion_arrays(distortion)},
        options=asdict(options),
        inputs=depends,
        stats=_stats(scores, trajectory.has_pose),
    )
    begun.forget()
    return scores


class _Run:
    """The work of one run: frames are matched once, their tiles give the scan's distortion, then the scores."""

    def __init__(
        self, opened: Recording, trajectory: Trajectory, scorer: FrameScorer, begun: BegunScores, report: Report
    ):
        self._opened, self._trajectory, self._scorer = opened, trajectory, scorer
        self._begun, self._report = begun, report
        self._with_pose = np.flatnonzero(trajectory.has_pose)
        rows = np.linspace(0, len(self._with_pose) - 1, min(len(self._with_pose), _COMPARED_FRAMES)).round().astype(int)
        self._compared = self._with_pose[rows]
        self._matched = len({*begun.tiles, *np.flatnonzero(begun.is_done).tolist()})

    def compare(self) -> ScanDistortion | None:
        """Where the scan is off itself, by frames that are spread evenly over the recording."""
        todo = [index for index in self._compared.tolist() if index not in self._begun.tiles]
        for index, rgb in self._opened.frames.iterate(todo):
            self._say(index)
            self._begun.put_tiles(index, self._scorer.match(rgb, self._pose(index)))
        equations = [self._scorer.equations(self._begun.tiles[i], self._pose(i)) for i in self._compared.tolist()]
        return scan_distortion([one for one in equations if one is not None])

    def score_all(self, distortion: ScanDistortion | None) -> None:
        """Score all frames that are not scored yet; those that were compared are not matched again."""
        for index in self._compared.tolist():
            tiles = self._begun.tiles[index]
            self._begun.put(index, self._scorer.judge(self._scorer.equations(tiles, self._pose(index)), distortion))
        todo: Ints = self._with_pose[~self._begun.is_done[self._with_pose]]
        for index, rgb in self._opened.frames.iterate(todo.tolist()):
            self._say(index)
            self._begun.put(index, self._scorer.score(rgb, self._pose(index), distortion))

    def _pose(self, index: int) -> RigidTransform:
        return self._trajectory.poses(np.array([index]))[0]

    def _say(self, index: int) -> None:
        self._report(self._matched / len(self._with_pose), f"frame {index}")
        self._matched += 1


def _distortion_arrays(distortion: ScanDistortion | None) -> dict[str, Floats]:
    """Where the scan is off, for whoever wants to look at it: (K, 3) places and displacements, metres, scan axes."""
    if distortion is None:
        return {}
    return {"scan_place": distortion.nodes, "scan_displacement_m": distortion.displacement_m}


def score_inputs(project: Project, recording: str, method: Method = Method.SFM) -> dict[str, str]:
    """The hashes that the scores depend on."""
    colors = project.scan_artifact("colors")
    return {
        "formula": FORMULA,
        "scan": inputs.scan_hash(project),
        "colors": colors.header().content if colors.exists else "of the scan's file",
        "recording": inputs.recording_hash(project, recording),
        "trajectory": project.result(recording, method, "trajectory").header().content,
    }


def load_scores(artifact: Artifact, count: int) -> FrameScores:
    """The scores of an artifact, of a recording of `count` frames.

    Raises:
        ProjectError: if they are missing, damaged, or of another number of frames.
    """
    arrays = artifact.read_arrays()
    if any(arrays.get(name, np.zeros(0)).shape != (count,) for name in COLUMNS):
        raise ProjectError(f"{artifact.folder}: the scores are not of {count} frames; remove it and score again.")
    return FrameScores(**{name: arrays[name] for name in COLUMNS})


def fresh_scores(project: Project, recording: str, method: Method) -> FrameScores | None:
    """The scores of a method's poses as these are now; None where there are none."""
    artifact = project.result(recording, method, "scores")
    if artifact.state(score_inputs(project, recording, method))[0] is not State.FRESH:
        return None
    return load_scores(artifact, int(project.result(recording, method, "trajectory").header().stats["frames"]))


def _stats(scores: FrameScores, has_pose: Bools) -> Mapping[str, float | int]:
    known = scores.known
    counts: dict[str, float | int] = {"frames with a pose": int(has_pose.sum()), "scored": len(known)}
    return counts | ({"median": round(float(np.median(known)), 4)} if len(known) else {})
