"""Charts by name in an artifact, so that they are drawn once and looked at often."""

from __future__ import annotations

from collections.abc import Mapping

from gazeloc_core.charts.values import Drawing, chart_from_json
from gazeloc_core.errors import ProjectError
from gazeloc_core.storage.artifacts import Artifact
from gazeloc_core.storage.files import read_json, write_json_atomically

_FILE = "charts.json"


def write_charts(artifact: Artifact, charts: Mapping[str, Drawing], notes: tuple[str, ...] = ()) -> None:
    """Keep charts, and in `notes` why others are missing."""
    artifact.write(
        lambda folder: write_json_atomically(folder / _FILE, {name: chart.to_json() for name, chart in charts.items()}),
        options={},
        inputs={},
        notes=notes,
    )


def read_charts(artifact: Artifact) -> tuple[dict[str, Drawing], tuple[str, ...]]:
    """The charts and notes of `write_charts`.

    Raises:
        ProjectError: if they have not been drawn, or the file is damaged.
    """
    header = artifact.header()
    try:
        rows = read_json(artifact.folder / _FILE, "charts")
        return {name: chart_from_json(value) for name, value in rows.items()}, header.notes
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ProjectError(f"{artifact.folder}: the charts are damaged ({error}); draw them again.") from error
