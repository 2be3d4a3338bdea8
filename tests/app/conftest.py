"""A folder with everything that the command line can be given, made once and copied for each test."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from app_project import make_app_project
from app_steps import stop
from fake_project import CLICKED, click, make_project
from gazeloc_app.app import App
from tiny_captures import write_colmap, write_image_folder, write_scan

from gazeloc_core.pipeline import run_stage, stage_named
from gazeloc_core.project import Project


@pytest.fixture(scope="session")
def _template(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("home")
    project = make_project(folder)
    shutil.copytree(project.folder, folder / "aligned")
    aligned = Project.open(folder / "aligned")
    click(aligned, CLICKED)
    for stage in ("alignment", "pieces", "trajectory", "gaze"):
        run_stage(aligned, stage_named(stage), "walk")
    write_scan(folder / "scan")
    write_image_folder(folder / "pictures")
    write_colmap(folder / "colmap", "text")
    return folder


@pytest.fixture
def home(tmp_path: Path, _template: Path) -> Path:
    """room.obj, scan/, walk/, pictures/, colmap/, truth.tum; project/ (reconstructed) and aligned/ (with poses)."""
    return Path(shutil.copytree(_template, tmp_path / "home"))


@pytest.fixture
def project(tmp_path: Path) -> Project:
    """A small project as the stages would have left it."""
    return make_app_project(tmp_path)


@pytest.fixture
def app(project: Project) -> Iterator[App]:
    """The app with its server, the loop not running: `step` applies what was dispatched."""
    app = App(project, port=0)
    app.store._render()
    yield app
    stop(app)
