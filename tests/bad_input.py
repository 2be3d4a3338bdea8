"""Tables of bad input: each case is refused with one sentence that names the file, the value and what to do.

A case makes its bad input under `tmp_path` and returns what the user would then do. Anything that is raised but a
`GazelocError` is a bug of ours and fails the test.
"""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from gazeloc_core.errors import GazelocError

Act = Callable[[], Any]
Prepare = Callable[[Path], Act]
Damage = Callable[[Path], Any]


class Table:
    """The cases of one test file, for `pytest.mark.parametrize(("prepare", "sentence"), table.cases)`."""

    def __init__(self) -> None:
        self.cases: list[Any] = []

    def case(self, name: str, sentence: str) -> Callable[[Prepare], Prepare]:
        """Add a case: its name and the regular expression that its sentence must match."""

        def add(prepare: Prepare) -> Prepare:
            self.cases.append(pytest.param(prepare, sentence, id=name))
            return prepare

        return add

    def damaged(self, kind: str, write: Callable[[Path], Path], open_it: Callable[[Path], Any]) -> Any:
        """A function `(name, sentence, damage)` that adds cases of valid input of one kind with one thing damaged."""

        def add(name: str, sentence: str, damage: Damage) -> None:
            def prepare(tmp_path: Path) -> Act:
                path = write(tmp_path / "capture")
                damage(path)
                return lambda: open_it(path)

            self.case(f"{kind}: {name}", sentence)(prepare)

        return add


def check_refused(act: Act, sentence: str) -> None:
    """Assert that an act is refused with one sentence, in which something follows what is wrong."""
    with pytest.raises(GazelocError, match=sentence) as raised:
        act()
    text = str(raised.value)
    assert "\n" not in text
    assert text.endswith(".")
    assert ";" in text or ": " in text


def cut(name: str, share: float) -> Damage:
    """Keep only the first part of a file (a pattern that one file matches)."""

    def damage(folder: Path) -> None:
        (path,) = folder.glob(name)
        content = path.read_bytes()
        path.write_bytes(content[: int(len(content) * share)])

    return damage


def change_json(name: str, **values: Any) -> Damage:
    """Replace values of a JSON object; `None` removes the key."""

    def damage(folder: Path) -> None:
        content = {**json.loads((folder / name).read_text()), **values}
        (folder / name).write_text(json.dumps({key: value for key, value in content.items() if value is not None}))

    return damage


def write(name: str, content: str | bytes, encoding: str = "utf-8") -> Damage:
    """Put other content into a file."""
    return lambda folder: (folder / name).write_bytes(
        content if isinstance(content, bytes) else content.encode(encoding)
    )


def remove(name: str) -> Damage:
    """Delete a file (a pattern that one file matches)."""

    def damage(folder: Path) -> None:
        (path,) = folder.glob(name)
        path.unlink()

    return damage


def into_folder(name: str) -> Damage:
    """Put an empty folder in the place of a file."""

    def damage(folder: Path) -> None:
        remove(name)(folder)
        (folder / name).mkdir()

    return damage
