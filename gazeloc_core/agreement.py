"""How well a frame and the render of the scan from its pose agree: a number from 0 to 1, and how far apart they look.

One correlation of both pictures says little: it depends on what the room looks like more than on the pose. So the
pictures are compared in tiles, each of which looks for its place around where the pose says that it is (the shift
with the largest correlation of gradient orientations: Fitch et al., "Orientation correlation", BMVC 2002). Exposure
and blur change a gradient's length and leave its orientation; holes of the scan are left out. The part of the tiles'
shifts that one small motion of the camera explains (robust least squares over its six degrees of freedom, with the
render's depth) is the pose's doing; what is left over is each tile's own error.

The score judges a frame against the scan: where the scan itself is off, true poses lose some of it too.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform

from gazeloc_core.arrays import Bytes, Floats
from gazeloc_core.camera import Camera
from gazeloc_core.render import RayRenderer
from gazeloc_core.scan import Mesh

Picture = NDArray[np.float32]
LOW_SCORE = 0.3
"""A frame that scores below this looks more than 0.75° off the scan, or has little in common with it."""
_MIN_TILES = 12
_ROUNDS = 10


@dataclass(frozen=True, kw_only=True)
class AgreementOptions:
    """How frames are compared with renders."""

    width_px: int = 320
    """Width of both pictures; small ones are cheap, and blur away what phone and glasses see differently."""
    blur_px: float = 1.0
    """Standard deviation of the blur before gradients are taken."""
    tile_px: int = 32
    """Side of a tile."""
    step_px: int = 16
    """Distance between tiles."""
    search_px: int = 10
    """How far a tile looks for its place, to each side."""
    half_deg: float = 0.5
    """The offset that halves the score; a tile follows the camera's motion that is left no more than this from it."""


@dataclass(frozen=True)
class Agreement:
    """`score` in 0 to 1, NaN where frame and render have too little structure in common to tell.

    `offset_deg` is how far the frame looks off the scan: the median angle by which the pose moves the tiles.
    """

    score: float
    offset_deg: float


UNKNOWN = Agreement(float("nan"), float("nan"))


class FrameScorer:
    """Compares frames of one camera, as recorded, with renders of one scan through the same lens."""

    def __init__(self, mesh: Mesh, camera: Camera, options: AgreementOptions | None = None):
        self._options = options or AgreementOptions()
        width = min(self._options.width_px, camera.width)
        self._camera = camera.scaled(width, max(1, round(width * camera.height / camera.width)))
        self._renderer = RayRenderer(mesh)

    def score(self, rgb: Bytes, scan_from_camera: RigidTransform) -> Agreement:
        """How well the frame (H, W, 3) agrees with the scan seen from this pose."""
        size = (self._camera.width, self._camera.height)
        frame = cv2.resize(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY), size, interpolation=cv2.INTER_AREA)
        rendered = self._renderer.render(self._camera, scan_from_camera)
        assert rendered.depth_m is not None, "rays give depth"
        render = cv2.cvtColor(rendered.rgb, cv2.COLOR_RGB2GRAY)
        is_scan = np.isfinite(rendered.depth_m)
        tiles = match_tiles(frame.astype(np.float32), render.astype(np.float32), is_scan, self._options)
        x, y = tiles.center_px.astype(int).T
        return agreement(tiles, rendered.depth_m[y, x], self._camera, self._options)


def agreement(tiles: Tiles, depth_m: Floats, camera: Camera, options: AgreementOptions) -> Agreement:
    """What the tiles' shifts say; `depth_m` (T,) is the render's at their centres, NaN where it has none there."""
    rays = camera.unproject(tiles.center_px)
    beside = [camera.unproject(tiles.center_px + step) - rays for step in ((0.5, 0.0), (0.0, 0.5))]
    per_px = 2 * np.stack(beside, axis=2)  # (T, 3, 2): how a ray changes by a pixel's step to the right and down
    known = np.isfinite(depth_m) & np.isfinite(rays).all(axis=1) & np.isfinite(per_px).all(axis=(1, 2))
    if known.sum() < _MIN_TILES:
        return UNKNOWN
    rays, per_px, shift = rays[known], per_px[known], tiles.shift_px[known]
    design = np.linalg.pinv(per_px) @ _moved_rays(rays, depth_m[known] / rays[:, 2])
    weight = np.clip(tiles.best[known], 0, None) ** 2
    explained, left_px = _explained(design, shift, tiles.sharpness[known], weight)
    px_deg = np.degrees(np.linalg.norm(per_px, axis=1).mean(axis=1))
    offset_deg = float(np.median(np.linalg.norm(explained, axis=1) * px_deg))
    share = float(np.average(left_px * px_deg < options.half_deg, weights=weight))
    is_explained = min(1.0, 2 * share)  # the motion is to be believed where half of the tiles follow it
    return Agreement(is_explained / (1 + (offset_deg / options.half_deg) ** 2), offset_deg)


def _moved_rays(rays: Floats, range_m: Floats) -> Floats:
    """How unit rays (T, 3) change, (T, 3, 6), when the camera turns by w (rad) and moves by t (m).

    A point X = range ray moves by -w x X - t in the camera, and its ray by the part of that across it, over the range.
    """
    across = np.eye(3) - rays[:, :, None] * rays[:, None, :]
    x, y, z = rays.T
    nil = np.zeros_like(x)
    crossed = np.stack([nil, -z, y, z, nil, -x, -y, x, nil], axis=1).reshape(-1, 3, 3)
    return np.concatenate([across @ crossed, -across / range_m[:, None, None]], axis=2)


def _explained(design: Floats, shift_px: Floats, sharpness: Floats, weight: Floats) -> tuple[Floats, Floats]:
    """The part (T, 2) of the shifts that one motion explains, and how much (T,) is left, in px.

    A tile with one straight edge knows its shift across the edge alone: what counts is `sharpness` (T, 2, 2) times the
    shift. Cauchy weights, with a scale from the median of what is left, keep strays out.
    """
    seen, wanted = sharpness @ design, np.einsum("nij,nj->ni", sharpness, shift_px)
    now, left, motion = weight, np.zeros(len(weight)), np.zeros(6)
    for _ in range(_ROUNDS):
        normal = np.einsum("n,nij,nik->jk", now, seen, seen)
        normal += 1e-6 * np.trace(normal) * np.eye(6)
        motion = np.linalg.solve(normal, np.einsum("n,nij,ni->j", now, seen, wanted))
        left = np.linalg.norm(wanted - seen @ motion, axis=1)
        now = weight / (1 + (left / max(1.48 * float(np.median(left)), 0.05)) ** 2)
    return np.asarray(design @ motion), left


@dataclass(frozen=True, eq=False)
class Tiles:
    """T tiles of a render that have structure: their centres `center_px` (T, 2), the shifts `shift_px` (T, 2) to their
    places in the frame, and the correlation there, `best` (T,) in -1 to 1.

    `sharpness` (T, 2, 2) is symmetric: 1 along the direction in which a tile's place is known best, less along others.
    """

    center_px: Floats
    shift_px: Floats
    best: Floats
    sharpness: Floats


def match_tiles(frame: Picture, render: Picture, is_scan: NDArray[np.bool_], options: AgreementOptions) -> Tiles:
    """Find each tile of the render in the frame; both grey (H, W), `is_scan` (H, W) where the render shows the scan."""
    reach, side = options.search_px, options.tile_px
    inside = cv2.erode(is_scan.astype(np.uint8), np.ones((5, 5), np.uint8))
    seen = _orientations(frame, options.blur_px, np.ones_like(inside))
    drawn = _orientations(render, options.blur_px, inside)
    height, width = frame.shape
    rows, tensors = [], []
    for y in range(reach, height - side - reach + 1, options.step_px):
        for x in range(reach, width - side - reach + 1, options.step_px):
            tile = drawn[y : y + side, x : x + side]
            if inside[y : y + side, x : x + side].mean() < 0.7 or np.square(tile).sum() < 0.05 * side * side:
                continue
            around = seen[y - reach : y + side + reach, x - reach : x + side + reach]
            scores = cv2.matchTemplate(around, tile, cv2.TM_CCORR_NORMED)
            j, i = np.unravel_index(int(np.argmax(scores)), scores.shape)
            dx, dy = _peak(scores, int(i), int(j))
            rows.append((x + side / 2, y + side / 2, dx - reach, dy - reach, scores[j, i]))
            tensors.append(np.einsum("yxi,yxj->ij", tile, tile))
    table = np.array(rows, dtype=np.float64).reshape(-1, 5)
    return Tiles(table[:, :2], table[:, 2:4], table[:, 4], _sharpness(np.array(tensors).reshape(-1, 2, 2)))


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
