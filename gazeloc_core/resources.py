"""Where the files are that ship with GazeLoc: what the browser loads, and the sample scene.

A wheel carries them inside the package (`gazeloc_core/shipped/`), a checkout has them beside it. An editable install
leaves stale copies of `shipped/` in site-packages, but never inside the checkout's own package, which is what is asked.
"""

from __future__ import annotations

from pathlib import Path

from gazeloc_core.errors import InputError

_PACKAGE = Path(__file__).resolve().parent


def static_file(name: str) -> Path:
    """A file of static/, e.g. "compare.css".

    Raises:
        InputError: if there is no such file, or the name leads out of static/.
    """
    path = _find("static", name)
    if not path.is_file():
        raise InputError(f"GazeLoc has no file static/{name}; install it again.")
    return path


def static_files(folder: str) -> list[Path]:
    """The files of a folder in static/, in the order of their names.

    Raises:
        InputError: if there is no such folder, or the name leads out of static/.
    """
    path = _find("static", folder)
    if not path.is_dir():
        raise InputError(f"GazeLoc has no folder static/{folder}; install it again.")
    return sorted(file for file in path.iterdir() if file.is_file())


def sample_scene(name: str) -> Path:
    """The folder of a sample scene, e.g. "studio".

    Raises:
        InputError: if this installation does not have it.
    """
    path = _find("sample_scenes", name)
    if not path.is_dir():
        raise InputError(
            f"The sample scene {name!r} is not part of this installation; "
            f"it has: {', '.join(sample_scenes()) or 'none'}."
        )
    return path


def sample_scenes() -> list[str]:
    """The names of the sample scenes that this installation has."""
    folders = (root / "sample_scenes" for root in _roots())
    return sorted({path.name for folder in folders if folder.is_dir() for path in folder.iterdir() if path.is_dir()})


def _roots() -> tuple[Path, ...]:
    return _PACKAGE / "shipped", _PACKAGE.parent


def _find(folder: str, name: str) -> Path:
    if not name or Path(name).is_absolute() or ".." in Path(name).parts:
        raise InputError(f"{name!r} is not the name of a file in {folder}/.")
    candidates = [root / folder / name for root in _roots()]
    return next((path for path in candidates if path.exists()), candidates[-1])
