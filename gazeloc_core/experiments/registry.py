"""The experiments by name, in the order of the paper."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from gazeloc_core.experiments.finding import Finding
from gazeloc_core.experiments.keypoint_table import figure_8
from gazeloc_core.experiments.marker_points import figure_9
from gazeloc_core.experiments.methods_table import table_2
from gazeloc_core.experiments.reconstructions import figure_14
from gazeloc_core.experiments.safe_tags import safe_range, tag_count
from gazeloc_core.experiments.shape_table import table_1
from gazeloc_core.experiments.shapes import figure_6
from gazeloc_core.experiments.tag_solver import tag_solver
from gazeloc_core.experiments.trajectories import figures_11_to_13
from gazeloc_core.experiments.workspace import Workspace
from gazeloc_core.progress import Report


@dataclass(frozen=True)
class Experiment:
    """One experiment: its title, and the function that runs it."""

    title: str
    run: Callable[[Workspace, Report], Finding]


EXPERIMENTS: dict[str, Experiment] = {
    "tag-solver": Experiment("Figures 2, 3 and 5: how good a tag's pose is", tag_solver),
    "figure-6": Experiment("Figure 6: registration by shape alone", figure_6),
    "figure-8": Experiment("Figure 8: how many keypoints", figure_8),
    "figure-9": Experiment("Figure 9: points under the tags", figure_9),
    "table-1": Experiment("Table I: shape alone against keypoints", table_1),
    "table-2": Experiment("Table II: tags against reconstruction", table_2),
    "figure-14": Experiment("Figure 14: reconstructions from phone and glasses", figure_14),
    "safe-range": Experiment("Section IX: the safe range of a tag", safe_range),
    "tag-count": Experiment("Section IX: the number of tags in the room", tag_count),
    "trajectories": Experiment("Figures 11 to 13: trajectories and renders", figures_11_to_13),
}
