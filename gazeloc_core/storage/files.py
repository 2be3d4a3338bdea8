"""Writing files so that a crash leaves the old one or the new one, never half of either; reading JSON of users."""

from __future__ import annotations

import itertools
import json
import os
import shutil
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from typing import Any

from gazeloc_core.errors import InputError


def write_text_atomically(path: Path, text: str) -> None:
    """Replace a text file in one step, see `write_bytes_atomically`."""
    write_bytes_atomically(path, text.encode("utf-8"))


def write_bytes_atomically(path: Path, content: bytes) -> None:
    """Replace a file in one step; on return the new one is on the disk.

    The order matters: content first, then the name, then the folder that holds the name. Else a power cut could leave
    the new name with nothing in it, or bring the old file back.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacement_of(path) as part:
        with part.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    flush_folder(path.parent)


@contextmanager
def replacement_of(path: Path) -> Iterator[Path]:
    """A file beside `path` to write and put in its place; another one for every process and thread, gone if that fails.

    Leftovers of a process that was killed meanwhile are `settle_folders`' to clear.
    """
    part = path.with_name(f".{path.name}.{os.getpid()}-{threading.get_ident()}.part")
    try:
        yield part
    except BaseException:
        part.unlink(missing_ok=True)
        raise


def flush_folder(folder: Path) -> None:
    """Put a folder's names on the disk, after files in it were made or renamed."""
    if os.name == "nt":  # Windows cannot open folders, and orders renames itself
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def write_json_atomically(path: Path, value: Any) -> None:
    """Replace a JSON file in one step; NaN and infinity are refused (they are not JSON)."""
    write_text_atomically(path, json.dumps(value, indent=1, allow_nan=False) + "\n")


def put_aside(path: Path) -> Path:
    """Rename a file or folder that is of no use to `<name>.damaged-<time>`; where it is now, beside earlier ones.

    Raises:
        InputError: if that fails.
    """
    place = _free_place(path, f"damaged-{datetime.now():%Y%m%d-%H%M%S}")
    try:
        path.rename(place)
    except OSError as error:
        problem = f"it is damaged and cannot be put aside ({error.strerror})"
        raise InputError.of(path, problem, "move it elsewhere, or mend the folder's permissions") from error
    return place


def copy_aside(path: Path) -> Path:
    """Copy a file that is about to be replaced to `<name>.other-<time>`; where the copy is, beside earlier ones.

    Raises:
        OSError: if that fails.
    """
    place = _free_place(path, f"other-{datetime.now():%Y%m%d-%H%M%S}")
    shutil.copy2(path, place)
    return place


def _free_place(path: Path, word: str) -> Path:
    endings = itertools.chain([word], (f"{word}-{number}" for number in itertools.count(2)))
    return next(place for place in (path.with_name(f"{path.name}.{one}") for one in endings) if not place.exists())


@contextmanager
def folder_replaced_atomically(folder: Path) -> Iterator[Path]:
    """A new empty folder to write into that takes the place of `folder` when the block ends well.

    If the block raises, the new folder goes and the old one stays as it was. A process that is killed between the two
    renames leaves the old one under its temporary name: `settle_folders` puts it back.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    part = folder.with_name(f".{folder.name}.{os.getpid()}.part")
    shutil.rmtree(part, ignore_errors=True)
    part.mkdir()
    try:
        yield part
    except BaseException:
        shutil.rmtree(part, ignore_errors=True)
        raise
    old = folder.with_name(f".{folder.name}.{os.getpid()}.old")
    shutil.rmtree(old, ignore_errors=True)
    if folder.exists():
        folder.rename(old)
    part.rename(folder)
    shutil.rmtree(old, ignore_errors=True)


def settle_folders(parent: Path) -> None:
    """Clear up after processes that were killed while they replaced a folder in `parent`.

    An old folder without a successor takes its place again; what else was left goes. Only for who holds the lock.
    """
    for left in sorted(parent.glob(".*.*.old")):
        place = parent / left.name[1:].rsplit(".", 2)[0]
        if not place.exists():
            left.rename(place)
    for left in [*parent.glob(".*.*.old"), *parent.glob(".*.*.part")]:
        if left.is_dir():
            shutil.rmtree(left, ignore_errors=True)
        else:
            left.unlink(missing_ok=True)


def read_json(path: Path, what: str) -> Any:
    """The value in a JSON file.

    Raises:
        InputError: if the file is missing, not UTF-8 or not JSON; `what` says what it should hold.
    """
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise InputError.of(path, f"the file is missing; it should hold {what}", "restore it") from error
    except (OSError, UnicodeDecodeError) as error:
        raise InputError.of(path, f"the file cannot be read ({error})", "restore it or its permissions") from error
    except (ValueError, RecursionError) as error:
        raise InputError.of(path, f"the file is not valid JSON ({error})", "restore or export it again") from error
