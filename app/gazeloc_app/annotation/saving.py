"""What people decided, saved before it is shown: the promise that what a browser has seen survives kill -9.

A step is acknowledged when views render it. Before that its line is in the recording's journal and on the disk
(`commit`); if that fails, the state is shown with a notice that says so, and every further action tries again. After
rendering, the files that the stages and the command line read (keypoints, project.json) are brought up to the journal
(`settle`), which is then marked as settled. A start that finds the mark missing was killed in between: the journal
wins. A start that finds it, but other files, follows the files: somebody changed them by other means.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime
from pathlib import Path

from gazeloc_app.annotation.history import History, all_lines, lines_between, read_lines
from gazeloc_app.state import ABOUT_THE_ROOM, MAX_UNDO, Annotation, AppState
from gazeloc_core.errors import GazelocError, ProjectError
from gazeloc_core.project import Chosen, Project
from gazeloc_core.storage.journal import Journal

MAX_LINES = 4 * MAX_UNDO
"""A journal that is longer is written anew, with the steps alone that can still be reached."""
IN_THE_JOURNAL = ("is_live", "compared_with")
"""The fields of `Annotation` that the app alone reads: the journal is their only place."""
_TAIL_BYTES = 256
_log = logging.getLogger(__name__)


class Saver:
    """Writes the annotations of one project, on the store's loop only; the caller holds the project's lock."""

    def __init__(self, project: Project, say: Callable[[str], None] = _log.warning):
        self._project = project
        self._say = say
        self._journals: dict[str, Journal] = {}
        self._lines: dict[str, int] = {}
        self._committed: dict[str, History] = {}
        self._wanted: dict[str, History] = {}
        self._unsettled: set[str] = set()

    def open(self, recording: str) -> History:
        """A recording's history, as it was left; damaged ones are put aside, and it begins anew from the files.

        Without a recording ("") people decide about the room alone, which has files of its own: the steps end with
        the app.
        """
        if recording in self._wanted:
            return self._wanted[recording]
        if not recording:
            self._committed[recording] = self._wanted[recording] = History((Annotation(),), 0)
            return self._wanted[recording]
        files = annotation_in_files(self._project, recording)
        try:
            journal = Journal(self._project.history_path(recording))
            lines = journal.read()
            history, is_settled = read_lines(lines) if lines else (History((files,), 0), True)
        except GazelocError as error:
            journal, lines = self._put_aside(recording, error), []
            history, is_settled = History((files,), 0), True
        self._journals[recording], self._lines[recording] = journal, len(lines)
        self._committed[recording] = self._wanted[recording] = history
        if not is_settled:
            self._unsettled.add(recording)
        else:
            elsewhere = (*ABOUT_THE_ROOM, *IN_THE_JOURNAL)
            files = replace(files, **{name: getattr(history.present, name) for name in elsewhere})
            if history.present != files:
                self._wanted[recording] = history.then(files)
        return self._wanted[recording]

    def room_after_a_kill(self, room: Annotation) -> Annotation:
        """What was decided about the room: as its files have it (`room`), or as a journal that a kill left unsettled.

        That one is the newer: the room's files are written after the journal (room_saving.py).
        """
        for recording in self._project.settings.recordings:
            if not _ends_settled(self._project.history_path(recording)):
                room = self.open(recording).present
        return room

    @property
    def has_unsaved(self) -> bool:
        """Whether something that people decided is in memory alone, or not yet in the files that stages read."""
        return bool(self._unsettled) or any(self._wanted[name] is not self._committed[name] for name in self._wanted)

    def commit(self, before: AppState, after: AppState) -> None:
        """Put every step on the disk, also of recordings that are not open. Before views render.

        Raises:
            ProjectError: if that fails; the steps are kept, and tried again next time.
        """
        del before
        history = History.of(after)
        if not history.is_same(self._wanted[after.recording]):
            self._wanted[after.recording] = history
        for suggested in after.suggested:
            elsewhere = self.open(suggested.recording)
            annotation = elsewhere.present.with_suggested(suggested)
            if annotation is not elsewhere.present:
                self._wanted[suggested.recording] = elsewhere.then(annotation)
        for name, wanted in self._wanted.items():
            if wanted is not self._committed[name]:
                try:
                    self._append(name, wanted)
                except OSError as error:
                    raise self._unsavable(error) from error

    def settle(self, before: AppState, after: AppState) -> None:
        """Bring the files that stages and the command line read up to what was committed. After views rendered.

        Raises:
            ProjectError: if that fails; it is tried again next time.
        """
        del before, after
        for name in sorted(self._unsettled):
            try:
                _write_files(self._project, name, self._committed[name].present)
                self._journals[name].append([{"settled": True}], flush=False)
            except OSError as error:
                raise self._unsavable(error) from error
            self._lines[name] += 1
            self._unsettled.remove(name)

    def _append(self, name: str, wanted: History) -> None:
        if not name:
            self._committed[name] = wanted
            return
        journal, committed = self._journals[name], self._committed[name]
        if self._lines[name] == 0 or self._lines[name] > MAX_LINES:
            lines = all_lines(wanted)
            journal.rewrite(lines)
            self._lines[name] = len(lines)
        else:
            lines = lines_between(committed, wanted)
            journal.append(lines)
            self._lines[name] += len(lines)
        self._committed[name] = wanted
        self._unsettled.add(name)

    def _put_aside(self, recording: str, error: GazelocError) -> Journal:
        path = self._project.history_path(recording)
        aside = path.with_name(f"{path.name}.damaged-{datetime.now():%Y%m%d-%H%M%S}")
        try:
            path.rename(aside)
        except OSError as failure:
            raise ProjectError(f"{path}: {error} It cannot be put aside either ({failure.strerror}).") from error
        self._say(f"{path}: {error} It was put aside as {aside.name}; undo begins anew, the keypoints are unharmed.")
        return Journal(path)

    def _unsavable(self, error: OSError) -> ProjectError:
        return ProjectError(
            f"{self._project.folder}: your last changes could not be saved ({error.strerror}); free some space "
            "or mend the folder's permissions and go on, they are kept until then."
        )


def annotation_in_files(project: Project, recording: str) -> Annotation:
    """What the project's own files say that people decided about a recording; the room has files of its own."""
    chosen = project.settings.chosen.get(recording)
    return Annotation(
        project.keypoints(recording),
        alignment=chosen.alignment if chosen else None,
        alignment_by_person=bool(chosen and chosen.by_person),
        method=project.method(recording),
        marks=project.marks(recording),
    )


def _ends_settled(journal: Path) -> bool:
    """Whether the last whole line is the mark; a look at the end alone, for a long line is none. True without lines."""
    try:
        with journal.open("rb") as file:
            file.seek(max(0, journal.stat().st_size - _TAIL_BYTES))
            tail = file.read()
    except OSError:
        return True
    lines = tail.split(b"\n")[:-1]
    try:
        return not lines or "settled" in json.loads(lines[-1])
    except (ValueError, TypeError):
        return False


def _write_files(project: Project, recording: str, annotation: Annotation) -> None:
    if project.keypoints(recording) != annotation.keypoints:
        project.save_keypoints(recording, annotation.keypoints)
    if project.marks(recording) != annotation.marks:
        project.save_marks(recording, annotation.marks)
    chosen = None
    if annotation.alignment is not None:
        chosen = Chosen(alignment=annotation.alignment, by_person=annotation.alignment_by_person)
    if project.settings.chosen.get(recording) != chosen:
        project.choose(recording, chosen)
    if project.method(recording) is not annotation.method:
        project.choose_method(recording, annotation.method)
