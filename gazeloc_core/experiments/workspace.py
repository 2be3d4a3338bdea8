"""Where experiments keep what costs time: made-up scenes, and the projects whose stages have run on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal

from gazeloc_core import pipeline
from gazeloc_core.evaluation.protocol import make_protocol_project
from gazeloc_core.methods import Method
from gazeloc_core.progress import Report, part, silent
from gazeloc_core.project import Project
from gazeloc_core.resources import sample_scene
from gazeloc_core.storage.files import folder_replaced_atomically
from gazeloc_core.storage.hashing import hash_of_value
from gazeloc_core.synthesis.scene_project import scene_settings
from gazeloc_core.synthetic import PRESETS, write_scene

SAMPLE = "studio"
Size = Literal["full", "small"]
TABLE_2 = ("table2-a-plain", "table2-a-hard", "table2-b-plain", "table2-b-hard")


@dataclass(frozen=True, kw_only=True)
class Workspace:
    """A folder of scenes and projects. Scenes are named by their options' hash, so that others are made anew."""

    cache: Path
    size: Size = "full"
    project_folder: Path | None = None
    """A user's own project, on which experiments that need no scene of ours run instead."""
    arkitscenes: tuple[Path, ...] = ()
    """ARKitScenes folders for Table I; the data is not ours to bring along."""

    def scene(self, preset: str, report: Report = silent) -> Path:
        """The files of a scene, written where they are not there yet."""
        if preset == SAMPLE:
            return sample_scene(SAMPLE)
        options = PRESETS[preset]
        folder = self.cache / f"{preset}-{hash_of_value(asdict(options))[:10]}"
        if not (folder / "scene.json").is_file():
            with folder_replaced_atomically(folder) as partial:
                write_scene(partial, options, report)
        return folder

    def project(self, preset: str, methods: Sequence[Method], report: Report = silent) -> Project:
        """The project of a scene, in which these methods have run. Recordings keep what is fresh."""
        scene = self.scene(preset, part(report, 0, 0.3))
        folder = self.cache / f"{scene.name}-project"
        if (folder / "project.json").is_file():
            project = Project.open(folder)
        else:
            project = Project.create(folder, scene_settings(scene, with_colmap=False))
        with project.lock():
            for number, method in enumerate(methods):
                share = part(report, 0.3 + 0.7 * number / len(methods), 0.3 + 0.7 * (number + 1) / len(methods))
                pipeline.run(project, method=method, report=share)
        return project

    def open_project(self, methods: Sequence[Method], report: Report = silent) -> Project:
        """The user's project as it is, else that of our first scene with these methods run."""
        if self.project_folder is not None:
            return Project.open(self.project_folder)
        return self.project(self.presets[0], methods, report)

    def protocol_project(self, scan: Path) -> Project:
        """A scan with posed frames by the paper's protocol: frames held out of it play the glasses'."""
        folder = self.cache / f"protocol-{scan.name}-{hash_of_value(str(scan.resolve()))[:10]}"
        if (folder / "project.json").is_file():
            return Project.open(folder)
        return make_protocol_project(folder, scan)

    @property
    def presets(self) -> tuple[str, ...]:
        """The scenes of Table II; for a small run the sample scene's own kind alone."""
        return TABLE_2 if self.size == "full" else (SAMPLE,)

    def describe(self) -> list[object]:
        """What findings depend on beside the code: sizes, scenes and the user's own data, as plain values."""
        scenes = [asdict(PRESETS[preset]) for preset in self.presets]
        return [self.size, scenes, str(self.project_folder), [str(folder) for folder in self.arkitscenes]]
