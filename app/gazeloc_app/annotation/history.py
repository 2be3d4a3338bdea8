"""The steps that people took: where they stand, what was before, what was undone. As lines of a journal, too.

{"start": {...}, "format": "gazeloc-history", "version": 1}   the annotation before the first step that is kept
{"step": {...}, "at": "2026-11-24T19:42:05"}                  what the next step changed; undone ones before it go
{"go": 3}                                                     undo, redo: people stand at the third step
{"settled": true}                                             the project's own files say the same
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from datetime import datetime
from itertools import pairwise
from typing import Any, NamedTuple

from gazeloc_app.annotation.annotation_json import changed_from_json, changes_to_json
from gazeloc_app.state import ABOUT_THE_ROOM, MAX_UNDO, Annotation, AppState
from gazeloc_core.errors import InputError

FORMAT = "gazeloc-history"
VERSION = 1


@dataclass(frozen=True)
class History:
    """All annotations from the first that is kept to the last that was undone, and which of them is in force."""

    annotations: tuple[Annotation, ...]
    position: int

    @classmethod
    def of(cls, state: AppState) -> History:
        """The history in a state."""
        return cls((*state.past, state.annotation, *state.future), len(state.past))

    def put_into(self, state: AppState) -> AppState:
        """A state with this history."""
        return replace(state, annotation=self.present, past=self.past, future=self.future)

    @property
    def past(self) -> tuple[Annotation, ...]:
        """What undo goes back to, the oldest first."""
        return self.annotations[: self.position]

    @property
    def present(self) -> Annotation:
        """What is in force."""
        return self.annotations[self.position]

    @property
    def future(self) -> tuple[Annotation, ...]:
        """What redo goes on to, the next first."""
        return self.annotations[self.position + 1 :]

    def is_same(self, other: History) -> bool:
        """Whether the other holds the very same annotations and stands at the same one."""
        return self.position == other.position and _are_same(self.annotations, other.annotations)

    def with_room_of(self, other: Annotation) -> History:
        """With what others decided about the room meanwhile, in all steps that know it as the present one does.

        It is no step here: undo goes on to take back what was done in this recording.
        """
        history = self
        for name in ABOUT_THE_ROOM:
            was, now = getattr(history.present, name), getattr(other, name)
            if was != now:
                brought = (
                    replace(one, **{name: now}) if getattr(one, name) == was else one for one in history.annotations
                )
                history = History(tuple(brought), history.position)
        return history

    def then(self, annotation: Annotation) -> History:
        """With one more step, as `AppState.annotate` does it."""
        past = (*self.past, self.present)[-MAX_UNDO:]
        return History((*past, annotation), len(past))


def all_lines(history: History) -> list[dict[str, Any]]:
    """The lines of a new journal that holds a history, not settled."""
    first = history.annotations[0]
    start = {"start": changes_to_json(Annotation(), first), "format": FORMAT, "version": VERSION}
    steps = _steps(history.annotations)
    return [start, *steps, *_going(len(steps), history.position)]


def lines_between(before: History, after: History) -> list[dict[str, Any]]:
    """What to append to a journal that holds `before`, so that it holds `after`."""
    offset = _offset(before, after)
    if offset is None:
        return all_lines(after)
    old = before.annotations[offset:]
    common = 0
    while common < min(len(old), len(after.annotations)) and old[common] is after.annotations[common]:
        common += 1
    if common == len(after.annotations) == len(old) and offset == 0:
        return _going(before.position, after.position)
    steps = after.annotations[common - 1 :]
    read = History(before.annotations, offset + common - 1)
    for annotation in steps[1:]:
        read = read.then(annotation)
    if not _are_same(read.annotations, after.annotations):  # e.g. undone steps that are gone though none was taken
        return all_lines(after)
    going = _going(before.position, offset + common - 1)
    return [*going, *_steps(steps), *_going(read.position, after.position)]


class Read(NamedTuple):
    """What a journal's lines hold."""

    history: History
    is_settled: bool
    passed: tuple[Annotation, ...]
    """What was in force when it was settled last, and since: the project's own files may say any of these."""


def read_lines(lines: Iterable[Any]) -> Read:
    """The history that a journal's lines hold, and how far it is settled.

    Raises:
        InputError: if they are garbled, or of another version.
    """
    history: History | None = None
    passed: list[Annotation] = []
    is_settled = False
    try:
        for line in lines:
            is_settled = "settled" in line
            passed = [] if is_settled else passed
            if "start" in line:
                history = _started(line)
            elif history is None:
                raise InputError("The history does not begin at its beginning.")
            elif "step" in line:
                history = history.then(changed_from_json(history.present, line["step"]))
            elif "go" in line:
                history = History(history.annotations, _checked_position(history, line["go"]))
            passed.append(history.present)
    except (TypeError, KeyError) as error:
        raise InputError(f"The history is garbled ({error}).") from error
    if history is None:
        raise InputError("The history is empty.")
    return Read(history, is_settled, tuple(passed))


def _started(line: Any) -> History:
    if line["format"] != FORMAT or line["version"] != VERSION:
        raise InputError(f"The history was written as {line['format']} version {line['version']}; update gazeloc.")
    return History((changed_from_json(Annotation(), line["start"]),), 0)


def _checked_position(history: History, value: Any) -> int:
    if not isinstance(value, int) or not 0 <= value < len(history.annotations):
        raise InputError(f"The history has no step {value!r}.")
    return value


def _offset(before: History, after: History) -> int | None:
    """How many of the oldest steps fell off the list; None where the two have nothing in common."""
    first = after.annotations[0]
    return next((i for i, annotation in enumerate(before.annotations) if annotation is first), None)


def _are_same(one: tuple[Annotation, ...], other: tuple[Annotation, ...]) -> bool:
    return len(one) == len(other) and all(a is b for a, b in zip(one, other, strict=True))


def _steps(annotations: tuple[Annotation, ...]) -> list[dict[str, Any]]:
    now = datetime.now().isoformat(timespec="seconds")
    return [{"step": changes_to_json(earlier, later), "at": now} for earlier, later in pairwise(annotations)]


def _going(position: int, target: int) -> list[dict[str, Any]]:
    return [] if position == target else [{"go": target}]
