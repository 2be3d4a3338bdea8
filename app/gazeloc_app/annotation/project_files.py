"""The files that stages and the command line read: what people decided about a recording, without its history.

The journal has the same (saving.py). So a damaged file is made again from it, and one that somebody changed while the
app was open is kept beside the app's own; both are said, nothing is lost.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

from gazeloc_app.state import Annotation
from gazeloc_core.errors import GazelocError
from gazeloc_core.project import Chosen, Project
from gazeloc_core.storage.files import copy_aside, put_aside

FIELDS = ("keypoints", "marks", "alignment", "alignment_by_person", "method")
"""The fields of `Annotation` that these files hold."""


class ProjectFiles:
    """Those of one project; the caller holds its lock."""

    def __init__(self, project: Project, say: Callable[[str], None]):
        self._project, self._say = project, say
        self._known: dict[str, Annotation] = {}

    def read(self, recording: str, otherwise: Annotation) -> tuple[Annotation, bool]:
        """What the files say, and whether all are whole; a damaged one is put aside, and `otherwise` counts."""
        chosen = self._project.settings.chosen.get(recording)
        found, is_whole = (
            Annotation(
                alignment=chosen.alignment if chosen else None,
                alignment_by_person=bool(chosen and chosen.by_person),
                method=self._project.method(recording),
            ),
            True,
        )
        for name, path in self._paths(recording):
            value = self._read(recording, name, path, "What the app's own history says is used.")
            is_whole = is_whole and value is not None
            found = replace(found, **{name: getattr(otherwise, name) if value is None else value})
        self._known[recording] = found
        return found, is_whole

    def write(self, recording: str, annotation: Annotation) -> None:
        """Bring the files up to what was decided.

        Raises:
            OSError: if that fails.
        """
        for name, path in self._paths(recording):
            self._write(recording, name, path, getattr(annotation, name))
        chosen = None
        if annotation.alignment is not None:
            chosen = Chosen(alignment=annotation.alignment, by_person=annotation.alignment_by_person)
        if self._project.settings.chosen.get(recording) != chosen:
            self._project.choose(recording, chosen)
        if self._project.method(recording) is not annotation.method:
            self._project.choose_method(recording, annotation.method)

    def _write(self, recording: str, name: str, path: Path, wanted: Any) -> None:
        known = self._known.get(recording, Annotation())
        value = self._read(recording, name, path, "It is written anew from what the app shows.")
        if value is not None and value not in (wanted, getattr(known, name)) and path.exists():
            aside = copy_aside(path)
            self._say(
                f"{path}: somebody else changed this file while the app was open; the app's own {name} are in force, "
                f"theirs are kept as {aside.name}."
            )
        if value != wanted:
            save = self._project.save_keypoints if name == "keypoints" else self._project.save_marks
            save(recording, wanted)
        self._known[recording] = replace(known, **{name: wanted})

    def _paths(self, recording: str) -> tuple[tuple[str, Path], ...]:
        return (
            ("keypoints", self._project.keypoints_path(recording)),
            ("marks", self._project.marks_path(recording)),
        )

    def _read(self, recording: str, name: str, path: Path, instead: str) -> Any:
        """The file's value; None where it was damaged and is put aside now."""
        try:
            return self._project.keypoints(recording) if name == "keypoints" else self._project.marks(recording)
        except GazelocError as error:
            aside = put_aside(path)
            about = str(error) if str(path) in str(error) else f"{path}: {error}"
            self._say(f"{about} It was put aside as {aside.name}. {instead}")
            return None


def annotation_in_files(project: Project, recording: str) -> Annotation:
    """What the project's own files say that people decided about a recording; the room has files of its own."""
    said: list[str] = []
    found, _ = ProjectFiles(project, said.append).read(recording, Annotation())
    return found


def are_explained(files: Annotation, passed: Iterable[Annotation]) -> bool:
    """Whether files say what was in force at some time since they were settled last: the app itself wrote them."""
    known = tuple(passed)
    return all(any(getattr(files, name) == getattr(one, name) for one in known) for name in FIELDS)
