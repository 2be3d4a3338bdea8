"""What `help(gazeloc_core)` shows a newcomer runs as it stands, and what is not there yet is a sentence."""

import re
import shutil
import textwrap

import numpy as np
import pytest
from fake_project import CLICKED, click, make_project

import gazeloc_core
from gazeloc_core import pipeline
from gazeloc_core.errors import InputError, ProjectError
from gazeloc_core.methods import Method


def examples() -> list[str]:
    """The indented parts of the package's docstring."""
    parts = re.findall(r"(?:^    .*\n|^\n(?=    ))+", gazeloc_core.__doc__ or "", flags=re.MULTILINE)
    return [textwrap.dedent(part) for part in parts]


def test_the_script_in_the_help_leads_from_files_to_poses_and_gaze(tmp_path, monkeypatch):
    project = make_project(tmp_path)
    click(project, CLICKED)
    monkeypatch.chdir(tmp_path)
    create, run = examples()
    names: dict = {}
    exec(create, names)
    assert names["project"].settings.recordings["walk"].path == tmp_path / "walk"
    shutil.rmtree("study")
    project.folder.rename("study")  # with a reconstruction, which takes minutes
    exec(run, names)
    trajectory, gaze = names["trajectory"], names["gaze"]
    assert trajectory.has_pose.sum() >= 3
    assert trajectory.pose(int(np.flatnonzero(trajectory.has_pose)[0])) is not None
    assert np.isfinite(gaze.hit[gaze.is_hit]).all()


def test_results_that_are_not_there_yet_are_a_sentence(tmp_path):
    project = make_project(tmp_path)
    with pytest.raises(InputError, match="no recording 'run'"):
        pipeline.trajectory(project, "run")
    with pytest.raises(ProjectError, match="gazeloc run"):
        pipeline.trajectory(project, "walk", Method.TAGS)
    with pytest.raises(ProjectError, match="gazeloc run"):
        pipeline.gaze(project, "walk")
