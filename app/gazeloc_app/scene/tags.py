"""Tags: outlines in space and their numbers."""

from __future__ import annotations

import numpy as np
import viser

from gazeloc_app.scene.placing import NodeGroup, place
from gazeloc_core.surfaces.glb import Rgb, lines_glb
from gazeloc_core.tag_types import TagCorners
from gazeloc_core.transforms import Similarity


class TagsLayer:
    """The tags of one side at `/tags/<name>`; `show` takes them in their own frame and the similarity into the scan."""

    def __init__(self, scene: viser.SceneApi, name: str, color: Rgb, suffix: str = ""):
        self._scene = scene
        self._name = f"/tags/{name}"
        self._color = color
        self._suffix = suffix
        self._tags: TagCorners | None = None
        self._outlines: viser.GlbHandle | None = None
        self._visible = True
        self._labels: NodeGroup[tuple[str, tuple[float, ...]]] = NodeGroup(self._make_label)

    def show(self, tags: TagCorners | None, scan_from_tags: Similarity | None = None) -> None:
        """Draw these tags; when only `scan_from_tags` changed, they are moved, not sent again."""
        similarity = scan_from_tags or Similarity.identity()
        if tags is not self._tags:
            self._tags = tags
            self._draw(tags)
        if self._outlines is not None:
            place(self._outlines, similarity)
        centers = similarity.apply(tags.centers) if tags is not None else np.zeros((0, 3))
        ids = tags.tag_id if tags is not None else ()
        self._labels.show(
            {
                f"{self._name}/{tag_id}": (f"{tag_id}{self._suffix}", tuple(np.round(center, 6).tolist()))
                for tag_id, center in zip(ids, centers, strict=True)
            }
        )

    def set_visible(self, visible: bool) -> None:
        """Show or hide the layer."""
        self._visible = visible
        self._labels.set_visible(visible)
        if self._outlines is not None:
            self._outlines.visible = visible

    def _draw(self, tags: TagCorners | None) -> None:
        if self._outlines is not None:
            self._outlines.remove()
            self._outlines = None
        if tags is None or len(tags) == 0:
            return
        edges = np.stack([tags.corners, np.roll(tags.corners, -1, axis=1)], axis=2).reshape(-1, 2, 3)
        crosses = np.stack([tags.corners[:, :2], tags.corners[:, 2:]], axis=2).reshape(-1, 2, 3)
        glb = lines_glb(np.concatenate([edges, crosses]), self._color)
        self._outlines = self._scene.add_glb(
            f"{self._name}-outlines", glb.to_bytes(), cast_shadow=False, receive_shadow=False, visible=self._visible
        )

    def _make_label(self, name: str, spec: tuple[str, tuple[float, ...]]) -> viser.LabelHandle:
        text, position = spec
        return self._scene.add_label(name, text, position=np.array(position), anchor="center-center")
