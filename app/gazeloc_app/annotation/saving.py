"""What people decided, saved before it is shown: the promise that what a browser has seen survives kill -9.

A step is acknowledged when views render it. Before that its line is in the recording's journal and on the disk
(`commit`); if that fails, the state is shown with a notice that says so, and every further action tries again. After
rendering, the files that the stages and the command line read (keypoints, project.json) are brought up to the journal
(`settle`), which is then marked as settled. A start that finds the mark missing was killed in between: the journal
wins, unless the files say what it never said: then it lacks its end. A start that finds the mark, but other files,
follows the files: somebody changed them by other means. Either way what the journal says is a step before.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from gazeloc_app.annotation.history import History, Read, all_lines, lines_between, read_lines
from gazeloc_app.annotation.project_files import ProjectFiles, are_explained
from gazeloc_app.state import ABOUT_THE_ROOM, MAX_UNDO, Annotation, AppState
from gazeloc_core.errors import GazelocError, ProjectError
from gazeloc_core.project import Project
from gazeloc_core.storage.files import put_aside
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
        self._files = ProjectFiles(project, say)
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
        read = self._open_journal(recording)
        files, are_whole = self._files.read(recording, read.history.present if read else Annotation())
        history = read.history if read else History((files,), 0)
        self._committed[recording] = self._wanted[recording] = history
        if not are_whole or (read is not None and not read.is_settled):
            self._unsettled.add(recording)
        if read is None or read.is_settled or not are_explained(files, read.passed):
            elsewhere = (*ABOUT_THE_ROOM, *IN_THE_JOURNAL)
            files = replace(files, **{name: getattr(history.present, name) for name in elsewhere})
            if history.present != files:
                self._wanted[recording] = history.then(files)
        return self._wanted[recording]

    def _open_journal(self, recording: str) -> Read | None:
        """What a recording's journal holds; None where it has none, or a damaged one, which is put aside."""
        path, read, lines = self._project.history_path(recording), None, []
        try:
            journal = Journal(path)
            lines = journal.read()
            if lines or path.exists():  # a new one is put in place whole, so that none is ever without a line
                read = read_lines(lines)
        except GazelocError as error:
            journal, lines = self._put_aside(recording, error), []
        self._journals[recording], self._lines[recording] = journal, len(lines)
        return read

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
        self._project.check_is_there()
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
                self._files.write(name, self._committed[name].present)
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
        if not journal.is_as_left and journal.path.exists():
            aside = put_aside(journal.path)
            self._say(f"{journal.path}: somebody else replaced this file; it was put aside as {aside.name}.")
        if not 0 < self._lines[name] <= MAX_LINES or not journal.is_as_left:
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
        aside = put_aside(path)
        about = str(error) if str(path) in str(error) else f"{path}: {error}"
        self._say(f"{about} It was put aside as {aside.name}; undo begins anew, the keypoints are unharmed.")
        return Journal(path)

    def _unsavable(self, error: OSError) -> ProjectError:
        return ProjectError(
            f"{self._project.folder}: your last changes could not be saved ({error.strerror}); free some space "
            "or mend the folder's permissions and go on, they are kept until then."
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
