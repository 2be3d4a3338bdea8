"""What the render process draws, as values to be sent to it: how to load a project's scan, recordings and tags."""

from __future__ import annotations

from functools import partial

from gazeloc_app.drawing.render_jobs import SeenTags, Sources
from gazeloc_core.project import Project
from gazeloc_core.stages import inputs
from gazeloc_core.stages.display import make_display


def sources_of(project: Project) -> Sources:
    """The sources of a project; nothing is loaded yet."""
    recordings = {name: partial(inputs.load_recording, project, name) for name in project.settings.recordings}
    tags = {name: partial(_seen_tags, project, name) for name in project.settings.recordings}
    mesh, display = partial(inputs.load_mesh, project), partial(make_display, project)
    return Sources(mesh=mesh, recordings=recordings, tags=tags, make_display=display)


def _seen_tags(project: Project, recording: str) -> SeenTags:
    artifact, entry = project.artifact(recording, "tags"), project.settings.tags
    sightings = inputs.load_sightings(artifact.read_arrays())
    return SeenTags(sightings, entry.size_m if entry else None)
