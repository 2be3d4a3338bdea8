"""Tracked frames of a run that has not ended: a file beside the stage's artifact, from which the next run goes on."""

from __future__ import annotations

import io
import json
import time
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from gazeloc_core.errors import GeometryError
from gazeloc_core.localize.track_evidence import Refusal
from gazeloc_core.localize.tracking import TRACKED_COLUMNS, Tracking, joined
from gazeloc_core.sfm_model import TrackedFrames
from gazeloc_core.storage.artifacts import Artifact
from gazeloc_core.storage.files import write_bytes_atomically

_KEEP_EVERY_S = 10.0


class BegunTracking:
    """What is done so far, model by model and stretch by stretch. A file of other inputs, or damaged, is not used."""

    def __init__(self, artifact: Artifact, key: str):
        """`key` names the inputs and options."""
        self._path: Path = artifact.folder.with_name("tracking.begun.npz")
        self._key = key
        self._saved_at = time.monotonic()
        self._parts: dict[int, list[Tracking]] = {}
        self._count: dict[int, int] = {}
        if self._path.is_file():
            self._load()

    def stretches(self, rank: int) -> int:
        """How many stretches of a model are done."""
        return self._count.get(rank, 0)

    def put(self, rank: int, stretch: Tracking) -> None:
        """One more stretch of a model is done."""
        self._parts.setdefault(rank, []).append(stretch)
        self._count[rank] = self.stretches(rank) + 1
        if time.monotonic() - self._saved_at > _KEEP_EVERY_S:
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
        content = io.BytesIO()
        np.savez(content, said=np.array(json.dumps({"of": self._key, "models": models})), **arrays)
        write_bytes_atomically(self._path, content.getvalue())
        self._saved_at = time.monotonic()

    def forget(self) -> None:
        """The run has ended."""
        self._path.unlink(missing_ok=True)

    def _load(self) -> None:
        try:
            with np.load(self._path, allow_pickle=False) as file:
                said = json.loads(str(file["said"]))
                if said["of"] != self._key:
                    return
                parts, count = {}, {}
                for rank, model in said["models"].items():
                    columns = {name: file[f"{rank}_{name}"] for name in TRACKED_COLUMNS}
                    refused = {Refusal(why): int(times) for why, times in model["refused"].items()}
                    parts[int(rank)] = [Tracking(TrackedFrames(**columns), int(model["tried"]), refused)]
                    count[int(rank)] = int(model["stretches"])
        except (OSError, EOFError, BadZipFile, KeyError, TypeError, ValueError, AttributeError, GeometryError):
            return
        self._parts, self._count = parts, count
