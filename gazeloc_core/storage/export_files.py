"""How exports reach the disk: whole or not at all, and never in place of a file that GazeLoc did not write."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from gazeloc_core.errors import InputError


def write_text_export(path: Path, text: str, is_ours: Callable[[Path], bool], *, overwrite: bool = False) -> Path:
    """Write `text` to `path` by way of a temporary file beside it.

    Raises:
        InputError: if another program's file is there and `overwrite` is not set, or the folder cannot be written.
    """
    refuse_foreign(path, is_ours, overwrite=overwrite)
    with staging_folder(path.parent) as staging:
        temporary = staging / path.name
        temporary.write_text(text, encoding="utf-8", newline="\n")
        temporary.replace(path)
    return path


def refuse_foreign(path: Path, is_ours: Callable[[Path], bool], *, overwrite: bool) -> None:
    """Raise InputError if something is at `path` that `is_ours` does not recognise, unless `overwrite`."""
    if path.is_dir():
        raise InputError.of(path, "a folder of this name is there", "choose another output folder")
    if path.exists() and not overwrite and not is_ours(path):
        raise InputError.of(path, "the file is there and GazeLoc did not write it", "choose another output folder")


@contextmanager
def staging_folder(folder: Path) -> Iterator[Path]:
    """A temporary folder inside `folder`, which is made if need be; what is still in it at the end is removed.

    Raises:
        InputError: if `folder` cannot be made or written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        temporary = tempfile.TemporaryDirectory(prefix=".gazeloc-", dir=folder)
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError.of(folder, f"cannot be written ({reason})", "choose another output folder") from error
    with temporary as name:
        try:
            yield Path(name)
        except OSError as error:
            reason = error.strerror or str(error)
            raise InputError.of(folder, f"cannot be written ({reason})", "free space or choose another") from error


def move_all(staging: Path, folder: Path) -> list[Path]:
    """Move every file below `staging` to the same place below `folder`; their new paths, sorted."""
    moved = []
    for source in sorted(path for path in staging.rglob("*") if path.is_file()):
        target = folder / source.relative_to(staging)
        target.parent.mkdir(parents=True, exist_ok=True)
        os.replace(source, target)
        moved.append(target)
    return moved


def starts_with(prefix: str) -> Callable[[Path], bool]:
    """The test whether a file's text begins with `prefix`."""

    def is_ours(path: Path) -> bool:
        with path.open("rb") as file:
            return file.read(len(prefix.encode())) == prefix.encode()

    return is_ours
