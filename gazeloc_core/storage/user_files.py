"""Text, JSON and CSV files of the user's, read with a sentence for whatever is wrong with them."""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from gazeloc_core.arrays import Floats
from gazeloc_core.errors import GazelocError, InputError

AGAIN = "export or copy it again"


def read_bytes(path: Path) -> bytes:
    """The content of a file.

    Raises:
        InputError: if it is missing, a folder, or may not be read.
    """
    if path.is_dir():
        raise InputError.of(path, "this is a folder, not a file", "name the file itself")
    try:
        return path.read_bytes()
    except FileNotFoundError as error:
        raise InputError.of(path, "the file is missing", AGAIN) from error
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError.of(path, f"the file cannot be read ({reason})", "check its permissions") from error


def read_text(path: Path) -> str:
    """The content of a UTF-8 text file, a byte order mark removed.

    Raises:
        InputError: as `read_bytes`, or if it is not UTF-8.
    """
    content = read_bytes(path)
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError.of(
            path, f"the file is not UTF-8 text (byte {error.start})", "save it as UTF-8 or export it again"
        ) from error


def read_json_object(path: Path) -> dict[str, Any]:
    """The JSON object in a file.

    Raises:
        InputError: as `read_text`, or if it is not a JSON object.
    """
    text = read_text(path)
    try:
        value = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError.of(path, f"the file is not valid JSON ({error})", AGAIN) from error
    if not isinstance(value, dict):
        raise InputError.of(path, f"expected a JSON object, found {type(value).__name__}", AGAIN)
    return value


def numbers_of(path: Path, value: dict[str, Any], key: str, count: int | None = None) -> Floats:
    """The finite numbers under `key` of a JSON object that was read from `path`, flattened, shape (count,).

    Raises:
        InputError: if the key is missing, holds something else, another count, or NaN.
    """
    if key not in value:
        raise InputError.of(path, f"the key {key!r} is missing", AGAIN)
    try:
        numbers = np.ravel(np.asarray(value[key], dtype=np.float64))
    except (TypeError, ValueError) as error:
        raise InputError.of(path, f"{key!r} does not hold numbers ({error})", AGAIN) from error
    if count is not None and len(numbers) != count:
        raise InputError.of(path, f"{key!r} holds {len(numbers)} numbers, expected {count}", AGAIN)
    if not np.isfinite(numbers).all():
        raise InputError.of(path, f"{key!r} holds a value that is not finite", AGAIN)
    return numbers


def read_csv(path: Path, required: tuple[str, ...]) -> dict[str, list[str]]:
    """The columns of a CSV file by header name, in lower case and stripped, each a list of strings.

    Raises:
        InputError: as `read_text`, or if a column of `required` is missing, a row is short, or there is no row.
    """
    try:
        rows = [row for row in csv.reader(io.StringIO(read_text(path), newline="")) if row]
    except csv.Error as error:
        raise InputError.of(path, f"the file is not CSV ({error})", AGAIN) from error
    if not rows:
        raise InputError.of(path, "the file is empty", AGAIN)
    header = [name.strip().lower() for name in rows[0]]
    for name in required:
        if name not in header:
            found = ", ".join(header[:12])
            raise InputError.of(path, f"the column {name!r} is missing (found: {found})", AGAIN)
    for line, row in enumerate(rows[1:], start=2):
        if len(row) != len(header):
            problem = f"row {line} has {len(row)} values, the header {len(header)}; the file may be cut off"
            raise InputError.of(path, problem, AGAIN)
    if len(rows) == 1:
        raise InputError.of(path, "the file has a header but no rows", AGAIN)
    return {name: [row[i].strip() for row in rows[1:]] for i, name in enumerate(header)}


def nanoseconds_of(path: Path, texts: list[str]) -> list[int]:
    """Whole nanoseconds from the cells of a CSV column, in the order of the file's rows (the first is row 2).

    Raises:
        InputError: with the row, if a cell is not a whole number of nanoseconds that fits 64 bits.
    """
    values = []
    for row, text in enumerate(texts, start=2):
        if not re.fullmatch(r"-?\d{1,19}(\.0*)?", text) or abs(int(text.split(".")[0])) >= 2**63:
            raise InputError.of(path, f"row {row} has the time {text!r}", "write times as whole nanoseconds")
        values.append(int(text.split(".")[0]))
    return values


def natural_key(name: str) -> list[tuple[int, int, str]]:
    """A sort key by which `frame_10` comes after `frame_9`."""
    parts = re.split(r"(\d+)", name)
    return [(1, int(part), "") if i % 2 else (0, 0, part.lower()) for i, part in enumerate(parts)]


@contextmanager
def about(path: Path) -> Iterator[None]:
    """Errors raised inside become errors about this file: its path goes before their sentence."""
    try:
        yield
    except GazelocError as error:
        if str(path) in str(error):
            raise
        raise InputError(f"{path}: {error}") from error
