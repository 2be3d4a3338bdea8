"""Stage: how well every frame with a pose agrees with the render of the scan from it, by one method's poses.

Scoring a long recording takes minutes. What is done is kept beside the artifact every few seconds, so that work that
was cancelled or killed goes on where it was.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from gazeloc_core.agreement import AgreementOptions, FrameScorer
from gazeloc_core.arrays import Bools, Floats
from gazeloc_core.artifacts import Artifact
from gazeloc_core.errors import InputError, ProjectError
from gazeloc_core.files import read_json, write_json_atomically
from gazeloc_core.hashing import hash_of_value
from gazeloc_core.methods import Method
from gazeloc_core.progress import Report, silent
from gazeloc_core.project import Project
from gazeloc_core.stages import inputs

_KEEP_EVERY_S = 5.0


@dataclass(frozen=True, eq=False)
class FrameScores:
    """Of all N frames, NaN where there is no pose or nothing to compare: see `agreement.Agreement`."""

    score: Floats
    offset_deg: Floats

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
    kept = _Kept(artifact, hash_of_value([depends, asdict(options)]), len(trajectory))
    todo = np.flatnonzero(trajectory.has_pose & ~kept.is_done)
    if len(todo):
        scorer = FrameScorer(inputs.load_mesh(project), opened.camera, options)
        try:
            for number, (index, rgb) in enumerate(opened.frames.iterate(todo.tolist())):
                report(number / len(todo), f"frame {index}")
                pose = trajectory.poses(np.array([index]))[0]
                found = scorer.score(rgb, pose)
                kept.put(index, found.score, found.offset_deg)
        finally:
            kept.save()
    scores = FrameScores(kept.score, kept.offset_deg)
    artifact.write_arrays(
        {"score": scores.score, "offset_deg": scores.offset_deg},
        options=asdict(options),
        inputs=depends,
        stats=_stats(scores, trajectory.has_pose),
    )
    kept.forget()
    return scores


def score_inputs(project: Project, recording: str, method: Method = Method.SFM) -> dict[str, str]:
    """The hashes that the scores depend on."""
    colors = project.scan_artifact("colors")
    return {
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
    if any(arrays.get(name, np.zeros(0)).shape != (count,) for name in ("score", "offset_deg")):
        raise ProjectError(f"{artifact.folder}: the scores are not of {count} frames; remove it and score again.")
    return FrameScores(arrays["score"], arrays["offset_deg"])


def _stats(scores: FrameScores, has_pose: Bools) -> Mapping[str, float | int]:
    known = scores.known
    counts: dict[str, float | int] = {"frames with a pose": int(has_pose.sum()), "scored": len(known)}
    return counts | ({"median": round(float(np.median(known)), 4)} if len(known) else {})


class _Kept:
    """What is done so far, in a file beside the artifact; one of other inputs, or a damaged one, is not used."""

    def __init__(self, artifact: Artifact, key: str, count: int):
        self._path: Path = artifact.folder.with_name("scores.begun.json")
        self._key = key
        self._saved_at = time.monotonic()
        self.score, self.offset_deg = np.full(count, np.nan), np.full(count, np.nan)
        self.is_done = np.zeros(count, np.bool_)
        if self._path.is_file():
            self._load()

    def put(self, index: int, score: float, offset_deg: float) -> None:
        self.score[index], self.offset_deg[index], self.is_done[index] = score, offset_deg, True
        if time.monotonic() - self._saved_at > _KEEP_EVERY_S:
            self.save()

    def save(self) -> None:
        done = np.flatnonzero(self.is_done)
        rows = [[int(i), _json_number(self.score[i]), _json_number(self.offset_deg[i])] for i in done]
        write_json_atomically(self._path, {"of": self._key, "frames": rows})
        self._saved_at = time.monotonic()

    def forget(self) -> None:
        self._path.unlink(missing_ok=True)

    def _load(self) -> None:
        try:
            value = read_json(self._path, "scores that were begun")
            rows = np.array(value["frames"], dtype=np.float64).reshape(-1, 3)  # null becomes NaN
            index = rows[:, 0].astype(np.int64)
            if value["of"] != self._key or (index < 0).any() or (index >= len(self.score)).any():
                return
        except (InputError, KeyError, TypeError, ValueError):
            return
        self.score[index], self.offset_deg[index], self.is_done[index] = rows[:, 1], rows[:, 2], True


def _json_number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
