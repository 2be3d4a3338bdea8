"""The demo: the sample scene as a project, kept between starts, its stages run on the first one."""

from __future__ import annotations

import os
from pathlib import Path

from gazeloc_app.app import serve
from gazeloc_core import __version__
from gazeloc_core.project import Project
from gazeloc_core.resources import sample_scene
from gazeloc_core.storage.hashing import FileHasher
from gazeloc_core.storage.user_cache import user_cache
from gazeloc_core.synthesis.scene_project import scene_settings

SCENE = "studio"


def open_demo(*, port: int = 8080) -> None:
    """Open the app on the sample scene. What is annotated there stays between starts."""
    project = demo_project(_folder())
    serve(project.folder, port=port, run_everything=not project.settings.chosen)


def demo_project(folder: Path) -> Project:
    """The project of the sample scene in a folder, made there if it is not there yet."""
    scene = sample_scene(SCENE)
    target = folder / f"{SCENE}-{__version__}-{FileHasher(folder / '.hashes.json').hash_of(scene)}"
    if (target / "project.json").is_file():
        return Project.open(target)
    return Project.create(target, scene_settings(scene))


def _folder() -> Path:
    asked = os.environ.get("GAZELOC_DEMO")
    return Path(asked) / "gazeloc" if asked else user_cache()
