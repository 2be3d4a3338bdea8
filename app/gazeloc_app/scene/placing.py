"""How nodes get their place: poses, similarities, and groups of nodes kept in step with data."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from typing import Generic, Protocol, TypeVar

import numpy as np
from scipy.spatial.transform import RigidTransform

from gazeloc_core.arrays import Floats
from gazeloc_core.transforms import Similarity, wxyz_of


class Node(Protocol):
    """Any viser node."""

    visible: bool

    def remove(self) -> None:
        """Take the node out of the scene."""
        ...


class ScalableNode(Protocol):
    """A viser node with a place and a size."""

    position: Floats
    wxyz: Floats
    scale: float | tuple[float, float, float]


def place(node: ScalableNode, scan_from_node: Similarity) -> None:
    """Put a node whose content is in another frame, such as `sfm`, into the scan: three small messages."""
    node.position = np.array(scan_from_node.translation)
    node.wxyz = wxyz_of(scan_from_node.rotation)
    node.scale = scan_from_node.scale


def pose_arguments(scan_from_node: RigidTransform) -> tuple[Floats, Floats]:
    """Quaternion and position as viser's `wxyz` and `position`."""
    return wxyz_of(scan_from_node.rotation), np.asarray(scan_from_node.translation, dtype=np.float64)


_Spec = TypeVar("_Spec", bound=Hashable)


class NodeGroup(Generic[_Spec]):
    """Nodes by name, each made from a description: only those whose description changed are sent again."""

    def __init__(self, make: Callable[[str, _Spec], Node]):
        self._make = make
        self._nodes: dict[str, tuple[_Spec, Node]] = {}
        self._visible = True

    def show(self, wanted: Mapping[str, _Spec]) -> None:
        """Draw exactly the `wanted` nodes."""
        for name in [name for name in self._nodes if name not in wanted]:
            self._nodes.pop(name)[1].remove()
        for name, spec in wanted.items():
            if name not in self._nodes or self._nodes[name][0] != spec:
                node = self._make(name, spec)  # viser replaces a node of the same name
                node.visible = self._visible
                self._nodes[name] = (spec, node)

    def set_visible(self, visible: bool) -> None:
        """Show or hide all nodes, and those to come."""
        if visible != self._visible:
            self._visible = visible
            for _, node in self._nodes.values():
                node.visible = visible
