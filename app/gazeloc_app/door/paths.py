"""Paths that come from a browser: in the address of a request, and as the name of a folder to write to."""

from __future__ import annotations

import re
from pathlib import Path
from urllib.parse import unquote

from gazeloc_core.errors import InputError

_PLAIN = re.compile(r"/(?!/)[!-~]{0,2047}")
_FOLDER = re.compile(r"[\w .()+-]{1,80}(/[\w .()+-]{1,80}){0,7}")


def is_plain(target: str) -> bool:
    """Whether a request's target is a path on this server that means the same to everybody who reads it.

    Refused: whole URLs, `//host`, backslashes, control characters and NUL, dot segments, each also percent-encoded
    once or twice.
    """
    if _PLAIN.fullmatch(target) is None:
        return False
    path = target.partition("?")[0]
    for _ in range(3):
        if "\\" in path or any(ord(letter) < 32 or ord(letter) == 127 for letter in path):
            return False
        if any(part in (".", "..") for part in path.split("/")):
            return False
        path = unquote(path)
    return True


def folder_inside(root: Path, name: str) -> Path:
    """The folder of this name inside of `root`, which need not exist yet; an empty name means `root` itself.

    Raises:
        InputError: if the name leads elsewhere, by `..`, an absolute path, a drive, `~` or a link.
    """
    name = name.strip().strip("/") if not name.strip().startswith("/") else name
    if not name:
        return root
    parts = name.split("/")
    if _FOLDER.fullmatch(name) is None or any(part.strip(" .") != part for part in parts):
        raise InputError(
            f"{name[:80]!r} is not a folder that can be written to; give a plain name, which is then made in {root}."
        )
    folder = root / name
    if not folder.resolve().is_relative_to(root.resolve()):
        raise InputError(f"{name!r} is a link that leads out of {root}; give another name.")
    return folder
