"""Artifacts: the result of one stage, a folder with a header that says how it came about.

    <stage>/header.json   format, version, stage, options, hashes of the inputs, hash of the content, notes, statistics
    <stage>/...           the content; arrays in one .npz, everything else in open formats
    <stage>.failed.json   why the stage failed the last time, where it did

An artifact is fresh while its inputs hash to what the header says. It is written beside its place and renamed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from gazeloc_core.errors import GazelocError, ProjectError
from gazeloc_core.storage.files import folder_replaced_atomically, read_json, write_json_atomically
from gazeloc_core.storage.hashing import FileHasher, hash_of_value

FORMAT = "gazeloc-artifact"
VERSION = 1
HEADER = "header.json"


class State(StrEnum):
    """Whether an artifact can be used."""

    FRESH = "fresh"
    STALE = "stale"
    MISSING = "missing"
    FAILED = "failed"


@dataclass(frozen=True)
class Header:
    """What an artifact says about itself."""

    stage: str
    options: Mapping[str, Any]
    inputs: Mapping[str, str]
    content: str
    notes: tuple[str, ...] = ()
    stats: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Artifact:
    """The place of one stage's result."""

    folder: Path

    @property
    def stage(self) -> str:
        """The stage's name, which is the folder's."""
        return self.folder.name

    @property
    def exists(self) -> bool:
        """Whether there is a result, fresh or stale."""
        return (self.folder / HEADER).is_file()

    @property
    def _failure(self) -> Path:
        return self.folder.with_name(f"{self.folder.name}.failed.json")

    @property
    def result_stamp(self) -> tuple[int, int] | None:
        """Tells the result from the next one in its place without reading it, since it is replaced as a whole; None
        without one."""
        return _stamp_of(self.folder / HEADER)

    def stamp(self) -> tuple[tuple[int, int] | None, ...]:
        """Tells what is there, the sentence of a failure too, from what was there before, without reading it."""
        return self.result_stamp, _stamp_of(self._failure)

    def header(self) -> Header:
        """What the artifact says about itself.

        Raises:
            ProjectError: if it is missing, damaged or of another version.
        """
        if not self.exists:
            raise ProjectError(f"{self.folder}: the result of the stage {self.stage!r} is missing; run `gazeloc run`.")
        value = read_json(self.folder / HEADER, "an artifact's header")
        try:
            if value["format"] != FORMAT or value["version"] != VERSION:
                raise ProjectError(
                    f"{self.folder}: written as {value['format']} version {value['version']}, this program reads "
                    f"{FORMAT} version {VERSION}; remove the folder and run again."
                )
            return Header(
                value["stage"],
                value["options"],
                value["inputs"],
                value["content"],
                tuple(value["notes"]),
                value["stats"],
            )
        except (KeyError, TypeError) as error:
            raise ProjectError(f"{self.folder}: the header is damaged ({error}); remove the folder.") from error

    def state(self, inputs: Mapping[str, str]) -> tuple[State, str]:
        """Whether the artifact is fresh for these inputs, and why not."""
        failure = self.failure(inputs)
        if failure is not None:
            return State.FAILED, failure
        if not self.exists:
            return State.MISSING, "not made yet"
        try:
            header = self.header()
        except GazelocError as error:
            return State.STALE, str(error)
        changed = sorted(name for name in {*inputs, *header.inputs} if inputs.get(name) != header.inputs.get(name))
        if changed:
            return State.STALE, f"changed since: {', '.join(changed)}"
        return State.FRESH, ""

    def write(
        self,
        make: Callable[[Path], None],
        *,
        options: Mapping[str, Any],
        inputs: Mapping[str, str],
        notes: tuple[str, ...] = (),
        stats: Mapping[str, Any] | None = None,
    ) -> None:
        """Let `make(folder)` write the content into a new folder, add the header, and put it in place."""
        with folder_replaced_atomically(self.folder) as part:
            make(part)
            content = FileHasher(part / ".none").hash_of(part)
            header = {
                "format": FORMAT,
                "version": VERSION,
                "stage": self.stage,
                "options": dict(options),
                "inputs": dict(inputs),
                "content": hash_of_value([content, self.stage]),
                "notes": list(notes),
                "stats": dict(stats or {}),
            }
            write_json_atomically(part / HEADER, header)
        self._failure.unlink(missing_ok=True)

    def write_arrays(self, arrays: Mapping[str, NDArray[Any]], **header: Any) -> None:
        """`write` with arrays alone as the content."""
        self.write(lambda folder: _save_arrays(folder / "arrays.npz", arrays), **header)

    def read_arrays(self) -> dict[str, NDArray[Any]]:
        """The arrays of `write_arrays`.

        Raises:
            ProjectError: if they are missing or damaged.
        """
        self.header()
        try:
            with np.load(self.folder / "arrays.npz", allow_pickle=False) as file:
                return {name: file[name] for name in file.files}
        except (OSError, ValueError, KeyError, EOFError, BadZipFile) as error:
            raise ProjectError(f"{self.folder}: the arrays are damaged ({error}); remove it and run again.") from error

    def remember_failure(self, error: GazelocError, inputs: Mapping[str, str]) -> None:
        """Keep the sentence of a failed run beside the artifact, which stays as it was."""
        write_json_atomically(self._failure, {"error": str(error), "inputs": dict(inputs)})

    def failure(self, inputs: Mapping[str, str]) -> str | None:
        """Why the stage failed on these very inputs, None where it did not."""
        if not self._failure.is_file():
            return None
        try:
            value = read_json(self._failure, "why a stage failed")
            return str(value["error"]) if value["inputs"] == dict(inputs) else None
        except (GazelocError, KeyError, TypeError):
            return None


def _save_arrays(path: Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    keywords: dict[str, Any] = dict(arrays)
    np.savez_compressed(path, **keywords)


def _stamp_of(path: Path) -> tuple[int, int] | None:
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_mtime_ns, status.st_ino
