"""The project settings of a made-up scene (synthetic.py), read from its scene.json."""

from __future__ import annotations

from pathlib import Path

from gazeloc_core.errors import InputError
from gazeloc_core.project import RecordingEntry, ScanEntry, Settings, TagEntry
from gazeloc_core.storage.files import read_json


def scene_settings(scene: Path, *, with_colmap: bool = True) -> Settings:
    """A project of the scene's scan and recordings; one of a single route is called `glasses`, others by their route.

    Raises:
        InputError: if the scene's description is missing or lacks a field.
    """
    facts = read_json(scene / "scene.json", "what a sample scene consists of")
    try:
        routes = facts.get("recordings", {"glasses": [facts["recording"], facts["truth"]]})
        colmap = scene / facts["colmap"] if with_colmap and facts["colmap"] else None
        return Settings(
            scan=ScanEntry(path=scene / facts["scan"]),
            tags=TagEntry(family=facts["tag_family"], size_m=facts["tag_size_m"]),
            recordings={
                name: RecordingEntry(
                    path=scene / recording, colmap=colmap if len(routes) == 1 else None, truth=scene / truth
                )
                for name, (recording, truth) in routes.items()
            },
        )
    except KeyError as error:
        raise InputError.of(scene / "scene.json", f"the field {error} is missing", "write the scene anew") from error
