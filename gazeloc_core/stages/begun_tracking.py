"""Tracked frames of a run that has not ended: a file beside the stage's artifact, from which the next run goes on."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from gazeloc_core.localize.track_evidence import Refusal
from gazeloc_core.localize.tracking import TRACKED_COLUMNS, Tracking, joined
from gazeloc_core.sfm_model import TrackedFrames
from gazeloc_core.storage.artifacts import Artifact
from gazeloc_core.storage.begun_file import Arrays, BegunFile

_KEEP_EVERY_S = 10.0


class BegunTracking:
    """What is done so far, model by model and stretch by stretch. A file of other inputs, or damaged, is not used."""

    def __init__(self, artifact: Artifact, key: str):
        """`key` names the inputs and options."""
        self._file = BegunFile(artifact.folder.with_name("tracking.begun.npz"), key, _KEEP_EVERY_S)
        self._parts: dict[int, list[Tracking]]
        self._count: dict[int, int]
        self._parts, self._count = self._file.read(_made) or ({}, {})

    def stretches(self, rank: int) -> int:
        """How many stretches of a model are done."""
        return self._count.get(rank, 0)

    def put(self, rank: int, stretch: Tracking) -> None:
        """One more stretch of a model is done."""
        self._parts.setdefault(rank, []).append(stretch)
        self._count[rank] = self.stretches(rank) + 1
        if self._file.is_due:
            self.save()

    def joined(self, rank: int) -> Tracking:
        """All that is done of a model."""
        return joined(self._parts.get(rank, []))

    def save(self) -> None:
        """Write what is done."""
        arrays: dict[str, Any] = {}
        models: dict[str, object] = {}
        for rank in self._parts:
            whole = self.joined(rank)
            self._parts[rank] = [whole]
            arrays |= {f"{rank}_{name}": getattr(whole.tracked, name) for name in TRACKED_COLUMNS}
            models[str(rank)] = {"stretches": self.stretches(rank), "tried": whole.tried, "refused": whole.refused}
        self._file.write(arrays | {"models": np.array(json.dumps(models))})

    def forget(self) -> None:
        """The run has ended."""
        self._file.forget()


def _made(arrays: Arrays) -> tuple[dict[int, list[Tracking]], dict[int, int]]:
    parts, count = {}, {}
    for rank, model in json.loads(str(arrays["models"])).items():
        columns = {name: arrays[f"{rank}_{name}"] for name in TRACKED_COLUMNS}
        refused = {Refusal(why): int(times) for why, times in model["refused"].items()}
        parts[int(rank)] = [Tracking(TrackedFrames(**columns), int(model["tried"]), refused)]
        count[int(rank)] = int(model["stretches"])
    return parts, count
