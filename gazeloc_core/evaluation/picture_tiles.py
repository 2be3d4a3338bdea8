"""How the parts of a frame lie against a render: tiles of the render, each looked for around its place in the frame.

A tile's place is the shift with the largest correlation of gradient orientations (Fitch et al., "Orientation
correlation", BMVC 2002): exposure and blur change a gradient's length and leave its orientation. Holes of the scan are
left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from gazeloc_core.arrays import Floats

Picture = NDArray[np.float32]
TABLE_WIDTH = 9


@dataclass(frozen=True, kw_only=True)
class TileOptions:
    """How pictures are cut into tiles, and how these are looked for."""

    width_px: int = 320
    """Width of both pictures; small ones are cheap, and blur away what phone and glasses see differently."""
    blur_px: float = 1.0
    """Standard deviation of the blur before gradients are taken."""
    tile_px: int = 32
    """Side of a tile."""
    step_px: int = 24
    """Distance between tiles."""
    search_px: int = 10
    """How far a tile looks for its place, to each side."""

    @property
    def overlap(self) -> float:
        """In how many tiles a pixel is: that many tell one and the same thing."""
        return (self.tile_px / self.step_px) ** 2


@dataclass(frozen=True, eq=False)
class Tiles:
    """T tiles of a render that have structure: their centres `center_px` (T, 2), the shifts `shift_px` (T, 2) to their
    places in the frame, and the correlation there, `best` (T,) in -1 to 1.

    `sharpness` (T, 2, 2) is symmetric: 1 along the direction in which a tile's place is known best, less along others.
    `depth_m` (T,) is the render's at their centres, NaN where it has none there.
    """

    center_px: Floats
    shift_px: Floats
    best: Floats
    sharpness: Floats
    depth_m: Floats

    def __len__(self) -> int:
        return len(self.best)

    def table(self) -> NDArray[np.float32]:
        """All of it in one table (T, `TABLE_WIDTH`), small enough to keep that of many frames; `of_table` reads it."""
        across = self.sharpness.reshape(-1, 4)[:, [0, 1, 3]]
        columns = (self.center_px, self.shift_px, self.best, across, self.depth_m)
        return np.column_stack(columns).astype(np.float32)

    @classmethod
    def of_table(cls, table: NDArray[np.float32]) -> Tiles:
        """The tiles of `table`."""
        wide = table.astype(np.float64)
        sharpness = wide[:, [5, 6, 6, 7]].reshape(-1, 2, 2)
        return cls(wide[:, :2], wide[:, 2:4], wide[:, 4], sharpness, wide[:, 8])


def match_tiles(frame: Picture, render: Picture, depth_m: Floats, options: TileOptions) -> Tiles:
    """Find each tile of the render in the frame; both grey (H, W), `depth_m` (H, W) NaN where there is no scan."""
    reach, side = options.search_px, options.tile_px
    inside = cv2.erode(np.isfinite(depth_m).astype(np.uint8), np.ones((5, 5), np.uint8))
    seen = _orientations(frame, options.blur_px, np.ones_like(inside))
    drawn = _orientations(render, options.blur_px, inside)
    height, width = frame.shape
    rows, tensors = [], []
    for top in range(reach, height - side - reach + 1, options.step_px):
        for left in range(reach, width - side - reach + 1, options.step_px):
            tile = drawn[top : top + side, left : left + side]
            if inside[top : top + side, left : left + side].mean() < 0.7 or np.square(tile).sum() < 0.05 * side * side:
                continue
            around = seen[top - reach : top + side + reach, left - reach : left + side + reach]
            scores = cv2.matchTemplate(around, tile, cv2.TM_CCORR_NORMED)
            j, i = np.unravel_index(int(np.argmax(scores)), scores.shape)
            dx, dy = _peak(scores, int(i), int(j))
            rows.append((left + side / 2, top + side / 2, dx - reach, dy - reach, scores[j, i]))
            tensors.append(np.einsum("yxi,yxj->ij", tile, tile))
    table = np.array(rows, dtype=np.float64).reshape(-1, 5)
    x, y = table[:, :2].astype(int).T
    sharpness = _sharpness(np.array(tensors).reshape(-1, 2, 2))
    return Tiles(table[:, :2], table[:, 2:4], table[:, 4], sharpness, depth_m[y, x])


def _sharpness(tensors: Floats) -> Floats:
    """The roots (T, 2, 2) of structure tensors (T, 2, 2) whose larger eigenvalue is made 1."""
    values, vectors = np.linalg.eigh(tensors)
    roots = np.sqrt(np.clip(values / np.maximum(values[:, 1:], 1e-12), 0, 1))
    return np.asarray(vectors * roots[:, None, :] @ np.swapaxes(vectors, 1, 2))


def _orientations(grey: Picture, blur_px: float, inside: NDArray[np.uint8]) -> Picture:
    """Gradients (H, W, 2) of length below 1: those stronger than the picture's middling ones count almost alike."""
    smooth = cv2.GaussianBlur(grey, (0, 0), blur_px)
    gradient = np.stack([cv2.Scharr(smooth, cv2.CV_32F, 1, 0), cv2.Scharr(smooth, cv2.CV_32F, 0, 1)], axis=2)
    gradient[inside == 0] = 0
    length = np.linalg.norm(gradient, axis=2)
    known = length[inside > 0]
    middling, strong = np.percentile(known, (70, 99)) if len(known) else (0.0, 0.0)
    return np.asarray(gradient / np.hypot(length, max(middling, 0.1 * strong, 1e-3))[..., None], np.float32)


def _peak(scores: Picture, i: int, j: int) -> tuple[float, float]:
    """The place of a maximum between pixels, by a parabola through its neighbours on each axis."""
    x, y = float(i), float(j)
    if 0 < i < scores.shape[1] - 1:
        x += _vertex(scores[j, i - 1], scores[j, i], scores[j, i + 1])
    if 0 < j < scores.shape[0] - 1:
        y += _vertex(scores[j - 1, i], scores[j, i], scores[j + 1, i])
    return x, y


def _vertex(before: float, at: float, after: float) -> float:
    bend = float(before) - 2 * float(at) + float(after)
    return 0.0 if bend >= -1e-9 else float(np.clip((float(before) - float(after)) / (2 * bend), -0.5, 0.5))
