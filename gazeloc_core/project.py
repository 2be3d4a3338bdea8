"""The project folder: one scan, any number of recordings, what people annotated, and what the stages made.

    PROJECT/
      project.json                     what belongs to the project (paths, tags), the alignment and method chosen
      annotations/<recording>.json     clicked keypoints
      annotations/<recording>.history.jsonl   every step that people took in the app, for undo (app: saving.py)
      annotations/marks/<recording>.json  what people think of frames' poses
      scan/<stage>/                    artifacts of the scan
      recordings/<recording>/<stage>/  artifacts of a recording
      recordings/<recording>/<method>/<stage>/  what one method made of it: poses, gaze
      recordings/<recording>/alignments/<key>.json   immutable, named by their content

Reading needs nothing; whoever writes holds the project's `WriteLock` (storage/lock.py). The scan and the recordings
stay where they are and are never written to.
"""

from __future__ import annotations

import os
import re
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from gazeloc_core.errors import InputError, ProjectError
from gazeloc_core.frames.marks import FrameMarks
from gazeloc_core.keypoints import KeypointSet
from gazeloc_core.methods import Method
from gazeloc_core.storage.artifacts import Artifact
from gazeloc_core.storage.files import read_json, settle_folders, write_json_atomically
from gazeloc_core.storage.hashing import FileHasher, hash_of_value
from gazeloc_core.storage.lock import WriteLock, brief_lock

FORMAT = "gazeloc-project"
VERSION = 1
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._ -]{0,80}")


@dataclass(frozen=True, kw_only=True)
class ScanEntry:
    """The project's scan: where it is, and what its file does not say."""

    path: Path
    unit: str | None = None
    up_axis: str | None = None


@dataclass(frozen=True, kw_only=True)
class TagEntry:
    """The tags in the room: their family, and their size in metres between the corners that the detector reports."""

    family: str
    size_m: float | None


@dataclass(frozen=True, kw_only=True)
class RecordingEntry:
    """One recording: where it is, a COLMAP model of it, names to times for that model, and the truth, if any."""

    path: Path
    colmap: Path | None = None
    colmap_times: Path | None = None
    truth: Path | None = None


@dataclass(frozen=True, kw_only=True)
class Chosen:
    """Which alignment of a recording is in force, and who chose it. A run never replaces what a person chose."""

    alignment: str
    by_person: bool


@dataclass(frozen=True, kw_only=True)
class Settings:
    """The content of project.json."""

    scan: ScanEntry
    tags: TagEntry | None = None
    recordings: dict[str, RecordingEntry] = field(default_factory=dict)
    chosen: dict[str, Chosen] = field(default_factory=dict)
    methods: dict[str, Method] = field(default_factory=dict)
    """The method whose poses a recording is shown and exported with, where a person chose one."""
    track_frames: bool = True
    """Whether the method `sfm` registers the frames between keyframes too; without, they are interpolated."""


@dataclass(frozen=True)
class Project:
    """A project folder that exists. `settings` is read anew at each access: another process may have written it."""

    folder: Path

    @classmethod
    def create(cls, folder: Path, settings: Settings) -> Project:
        """Make a new project folder.

        Raises:
            ProjectError: if the folder already holds a project or anything else.
        """
        check_new_folder(folder)
        for name in settings.recordings:
            _check_name(name)
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ProjectError(f"{folder}: the folder cannot be made ({error.strerror}); name another.") from error
        project = cls(folder.resolve())
        project.save(settings)
        return project

    @classmethod
    def open(cls, folder: Path) -> Project:
        """The project in a folder.

        Raises:
            ProjectError: if there is none, or it is damaged or of another version.
        """
        if not (folder / "project.json").is_file():
            raise ProjectError(f"{folder}: there is no project.json; make a project with `gazeloc new`.")
        project = cls(folder.resolve())
        _ = project.settings
        return project

    @property
    def settings(self) -> Settings:
        """What project.json says now."""
        path = self.folder / "project.json"
        value = read_json(path, "the project's settings")
        try:
            if value["format"] != FORMAT or value["version"] != VERSION:
                raise ProjectError(
                    f"{path}: written as {value['format']} version {value['version']}; this program reads "
                    f"{FORMAT} version {VERSION}, update gazeloc."
                )
            return self._settings_from_json(value)
        except KeyError as error:
            raise ProjectError(f"{path}: the settings are damaged at {error}; restore the file.") from error
        except (TypeError, AttributeError, ValueError) as error:
            raise ProjectError(f"{path}: the settings are damaged ({error}); restore the file.") from error

    def save(self, settings: Settings) -> None:
        """Write project.json."""
        write_json_atomically(self.folder / "project.json", self._settings_to_json(settings))

    def lock(self) -> WriteLock:
        """The right to write, held until released.

        Raises:
            ProjectLockedError: if another process holds it.
        """
        return WriteLock(self.folder / ".lock")

    def _changing_settings(self) -> AbstractContextManager[None]:
        return brief_lock(self.folder / ".settings.lock")

    def settle(self) -> None:
        """Clear up after a process that was killed while it wrote. Only for who holds the lock."""
        for parent in (self.folder, *(self.folder / where for where in ("annotations", "scan"))):
            settle_folders(parent)
        for recording in self.folder.glob("recordings/*"):
            for parent in (recording, *(recording / method.value for method in Method)):
                settle_folders(parent)

    def check_is_there(self) -> None:
        """Whoever writes on and on asks this before: a folder made anew in its place would hide what is missing.

        Raises:
            ProjectError: if the folder was renamed, moved or removed since it was opened.
        """
        if not (self.folder / "project.json").is_file():
            raise ProjectError(
                f"{self.folder}: the project is no longer there (renamed, moved?), so your last changes cannot be "
                "saved; put it back, they are kept in here until then."
            )

    def add_recording(self, name: str, entry: RecordingEntry) -> None:
        """Add one recording.

        Raises:
            ProjectError: if the name is taken or cannot be a folder's name.
        """
        _check_name(name)
        with self._changing_settings():
            settings = self.settings
            if name in settings.recordings:
                raise ProjectError(
                    f"{self.folder}: a recording is already called {name!r}; choose another with --name."
                )
            self.save(replace(settings, recordings={**settings.recordings, name: entry}))

    def recording(self, name: str) -> RecordingEntry:
        """One recording's entry.

        Raises:
            InputError: if there is none of this name.
        """
        recordings = self.settings.recordings
        if name not in recordings:
            raise InputError(
                f"{self.folder}: there is no recording {name!r}; the project has {', '.join(recordings) or 'none'}."
            )
        return recordings[name]

    def choose(self, recording: str, chosen: Chosen | None) -> None:
        """Put an alignment in force, or none."""
        with self._changing_settings():
            settings = self.settings
            others = {name: value for name, value in settings.chosen.items() if name != recording}
            self.save(replace(settings, chosen=others if chosen is None else {**others, recording: chosen}))

    def method(self, recording: str) -> Method:
        """The method whose poses a recording is shown and exported with."""
        return self.settings.methods.get(recording, Method.SFM)

    def choose_method(self, recording: str, method: Method) -> None:
        """Show and export a recording with another method's poses from now on."""
        with self._changing_settings():
            settings = self.settings
            self.save(replace(settings, methods={**settings.methods, recording: method}))

    def choose_tracking(self, track_frames: bool) -> None:
        """Register the frames between keyframes too from now on, or not."""
        with self._changing_settings():
            self.save(replace(self.settings, track_frames=track_frames))

    def scan_artifact(self, stage: str) -> Artifact:
        """The place of a stage's result about the scan."""
        return Artifact(self.folder / "scan" / stage)

    def artifact(self, recording: str, stage: str) -> Artifact:
        """The place of a stage's result about a recording."""
        return Artifact(self.folder / "recordings" / recording / stage)

    def result(self, recording: str, method: Method, stage: str) -> Artifact:
        """The place of what one method made of a recording."""
        return Artifact(self.folder / "recordings" / recording / method.value / stage)

    def alignments_folder(self, recording: str) -> Path:
        """Where a recording's immutable alignments are."""
        return self.folder / "recordings" / recording / "alignments"

    def keypoints(self, recording: str) -> KeypointSet:
        """The clicked keypoints of a recording, empty where nobody clicked."""
        path = self.keypoints_path(recording)
        return KeypointSet.from_json(read_json(path, "clicked keypoints")) if path.exists() else KeypointSet()

    def save_keypoints(self, recording: str, keypoints: KeypointSet) -> None:
        """Write the clicked keypoints of a recording."""
        write_json_atomically(self.keypoints_path(recording), keypoints.to_json())

    def history_path(self, recording: str) -> Path:
        """The file of the steps that people took in the app."""
        return self.folder / "annotations" / f"{recording}.history.jsonl"

    def marks(self, recording: str) -> FrameMarks:
        """What people think of the frames of a recording, empty where nobody marked any."""
        path = self.marks_path(recording)
        return FrameMarks.from_json(read_json(path, "marks of frames")) if path.exists() else FrameMarks()

    def save_marks(self, recording: str, marks: FrameMarks) -> None:
        """Write what people think of the frames of a recording."""
        if len(marks) or self.marks_path(recording).exists():
            write_json_atomically(self.marks_path(recording), marks.to_json())

    def hash_of_file(self, path: Path) -> str:
        """The content hash of a file or folder outside the project, remembered between runs."""
        hasher = FileHasher(self.folder / ".hashes.json")
        value = hasher.hash_of(path)
        hasher.remember()
        return value

    def hash_of_keypoints(self, recording: str) -> str:
        """The hash of what takes part in an alignment: names and renaming do not change it."""
        _, scan, sfm = self.keypoints(recording).counting()
        return hash_of_value([scan.tolist(), sfm.tolist()])

    def keypoints_path(self, recording: str) -> Path:
        """The file of clicked keypoints."""
        return self.folder / "annotations" / f"{recording}.json"

    def marks_path(self, recording: str) -> Path:
        """The file of what people think of frames."""
        return self.folder / "annotations" / "marks" / f"{recording}.json"

    def _stored(self, path: Path | None) -> str | None:
        """Relative to the project where that stays below a common parent, so that both can be moved together."""
        if path is None:
            return None
        path = path.resolve()
        try:
            relative = os.path.relpath(path, self.folder)
        except ValueError:  # another drive on Windows
            return str(path)
        return Path(relative).as_posix() if relative.count("..") <= 2 else str(path)

    def _path(self, text: str | None) -> Path | None:
        return None if text is None else Path(os.path.normpath(self.folder / text))

    def _settings_to_json(self, settings: Settings) -> dict[str, Any]:
        return {
            "format": FORMAT,
            "version": VERSION,
            "scan": {
                "path": self._stored(settings.scan.path),
                "unit": settings.scan.unit,
                "up_axis": settings.scan.up_axis,
            },
            "tags": settings.tags and {"family": settings.tags.family, "size_m": settings.tags.size_m},
            "recordings": {
                name: {
                    "path": self._stored(entry.path),
                    "colmap": self._stored(entry.colmap),
                    "colmap_times": self._stored(entry.colmap_times),
                    "truth": self._stored(entry.truth),
                }
                for name, entry in settings.recordings.items()
            },
            "chosen": {
                name: {"alignment": chosen.alignment, "by_person": chosen.by_person}
                for name, chosen in settings.chosen.items()
            },
            "methods": {name: method.value for name, method in settings.methods.items()},
            "track_frames": settings.track_frames,
        }

    def _settings_from_json(self, value: dict[str, Any]) -> Settings:
        scan, tags = value["scan"], value["tags"]
        for name in value["recordings"]:
            _check_name(name)
        return Settings(
            scan=ScanEntry(path=self._required(scan["path"]), unit=scan["unit"], up_axis=scan["up_axis"]),
            tags=tags and TagEntry(family=str(tags["family"]), size_m=_number(tags["size_m"])),
            recordings={
                name: RecordingEntry(
                    path=self._required(entry["path"]),
                    colmap=self._path(entry["colmap"]),
                    colmap_times=self._path(entry["colmap_times"]),
                    truth=self._path(entry["truth"]),
                )
                for name, entry in value["recordings"].items()
            },
            chosen={
                name: Chosen(alignment=chosen["alignment"], by_person=chosen["by_person"])
                for name, chosen in value["chosen"].items()
            },
            methods={name: Method(method) for name, method in value.get("methods", {}).items()},
            track_frames=bool(value.get("track_frames", True)),
        )

    def _required(self, text: str) -> Path:
        path = self._path(text)
        if path is None:
            raise ValueError("a path that is null")
        return path


def check_new_folder(folder: Path) -> None:
    """Refuse a folder in which no new project can be made, because something is there.

    Raises:
        ProjectError: if it already holds a project or anything else.
    """
    if (folder / "project.json").exists():
        raise ProjectError(f"{folder}: there is a project already; add recordings with `gazeloc add`.")
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise ProjectError(f"{folder}: the folder is not empty; name a new one for the project.")


def _number(value: Any) -> float | None:
    return None if value is None else float(value)


def _check_name(name: str) -> None:
    if not _NAME.fullmatch(name):
        raise ProjectError(
            f"The name {name!r} cannot be used for a recording; use letters, digits, '.', '_', '-' and spaces."
        )
