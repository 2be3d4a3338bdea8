"""A folder with everything that the command line can be given, made once and copied for each test."""

import shutil
from pathlib import Path

import pytest
from fake_project import CLICKED, click, make_project
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
