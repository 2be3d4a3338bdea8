"""How well a frame and the render of the scan from its pose agree: a number from 0 to 1, and how far apart they look.

One correlation of both pictures says little: it depends on what the room looks like more than on the pose. So tiles of
the render are looked for in the frame (`picture_tiles`), and the motion of the camera that explains their shifts
(`apparent_motion`) is the pose's doing. It is weighed against what the tiles cannot tell and against what true poses
are off themselves (a Mahalanobis length), so that a centimetre counts alike near and far.

A scan is off itself, by centimetres at some places, and true poses then look off by as much. What all frames of a
recording see of that is known once they are compared together (`scan_distortion`), and is not held against a frame.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import cv2
import numpy as np
from scipy.spatial.transform import RigidTransform

from gazeloc_core.arrays import Bytes, Floats
from gazeloc_core.camera import Camera
from gazeloc_core.evaluation.apparent_motion import TileEquations, apparent_motion, tile_equations
from gazeloc_core.evaluation.picture_tiles import TileOptions, Tiles, match_tiles
from gazeloc_core.evaluation.scan_distortion import ScanDistortion
from gazeloc_core.scan import Mesh
from gazeloc_core.surfaces.render import RayRenderer

LOW_SCORE = 0.3
"""A frame that scores below this looks more than 2 cm or 1° off the scan, or has little in common with it."""


@dataclass(frozen=True, kw_only=True)
class AgreementOptions:
    """What counts as agreement."""

    tiles: TileOptions = field(default_factory=TileOptions)
    good_m: float = 0.006
    """Standard deviation, along each axis, of how far true poses look off a good scan."""
    good_deg: float = 0.3
    """The same of turns."""
    half_at: float = 2.2
    """The offset that halves the score, in such standard deviations: 1.3 cm or 0.66° where the tiles tell well."""
    half_picture_deg: float = 0.7
    """The offset in the picture that halves the score, however little the tiles tell about the motion."""
    follow_deg: float = 0.5
    """A tile follows the camera's motion that is left no more than this from it."""
    vague_m: float = 0.3
    """An offset whose standard deviation is larger is not told."""
    vague_deg: float = 10.0
    """The same of turns."""


@dataclass(frozen=True)
class Agreement:
    """`score` in 0 to 1; all NaN where frame and render have too little structure in common to tell.

    `offset_deg` is how far the frame looks off the scan in the picture: the median angle by which the pose moves the
    tiles. `shift_m` and `turn_deg` are how far off the camera looks, each with its standard deviation, the scatter of
    true poses on good scans included. `scan_shift_m` is how much further or less off it would look if what all frames
    see of the scan's own distortion were held against it; 0 where that is not known.

    All but the score are NaN where less than half of the tiles move as one, or where they hardly tell the motion: a
    camera that is off by much more than tiles are looked for looks off by a few centimetres in any direction, and that
    is no measurement.
    """

    score: float
    offset_deg: float
    shift_m: float
    shift_sigma_m: float
    turn_deg: float
    turn_sigma_deg: float
    scan_shift_m: float


UNKNOWN = Agreement(*[float("nan")] * 7)


class FrameScorer:
    """Compares frames of one camera, as recorded, with renders of one scan through the same lens."""

    def __init__(self, mesh: Mesh, camera: Camera, options: AgreementOptions | None = None):
        self._options = options or AgreementOptions()
        width = min(self._options.tiles.width_px, camera.width)
        self._camera = camera.scaled(width, max(1, round(width * camera.height / camera.width)))
        self._renderer = RayRenderer(mesh)

    def match(self, rgb: Bytes, scan_from_camera: RigidTransform) -> Tiles:
        """The tiles of the scan as seen from this pose, where they are in the frame (H, W, 3). What takes long."""
        size = (self._camera.width, self._camera.height)
        frame = cv2.resize(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY), size, interpolation=cv2.INTER_AREA)
        rendered = self._renderer.render(self._camera, scan_from_camera)
        assert rendered.depth_m is not None, "rays give depth"
        render = cv2.cvtColor(rendered.rgb, cv2.COLOR_RGB2GRAY)
        return match_tiles(frame.astype(np.float32), render.astype(np.float32), rendered.depth_m, self._options.tiles)

    def equations(self, tiles: Tiles, scan_from_camera: RigidTransform) -> TileEquations | None:
        """What the tiles say of the pose and of the scan; None where they are too few."""
        return tile_equations(tiles, self._camera, scan_from_camera)

    def judge(self, equations: TileEquations | None, distortion: ScanDistortion | None = None) -> Agreement:
        """The agreement that the tiles of a frame show, on a scan that is known to be off by `distortion`."""
        return UNKNOWN if equations is None else agreement(equations, distortion, self._options)

    def score(
        self, rgb: Bytes, scan_from_camera: RigidTransform, distortion: ScanDistortion | None = None
    ) -> Agreement:
        """How well the frame (H, W, 3) agrees with the scan seen from this pose."""
        return self.judge(self.equations(self.match(rgb, scan_from_camera), scan_from_camera), distortion)


def agreement(equations: TileEquations, distortion: ScanDistortion | None, options: AgreementOptions) -> Agreement:
    """What the tiles of one frame say."""
    overlap = options.tiles.overlap
    of_scan = None if distortion is None else distortion.at(equations.place_in_scan)
    motion = apparent_motion(equations, of_scan, overlap)
    scatter = motion.covariance + np.diag([np.radians(options.good_deg) ** 2] * 3 + [options.good_m**2] * 3)
    length = float(np.sqrt(motion.value @ np.linalg.solve(scatter, motion.value)))
    follows = motion.left * equations.px_deg < options.follow_deg
    share = float(np.average(follows, weights=equations.weight))
    is_explained = min(1.0, 2 * share)  # the motion is to be believed where half of the tiles follow it
    offset_deg = float(np.median(np.linalg.norm(equations.picture_deg @ motion.value, axis=1)))
    score = is_explained / (1 + max(length / options.half_at, offset_deg / options.half_picture_deg) ** 2)
    shift_m, shift_sigma_m = _length(motion.value[3:], scatter[3:, 3:])
    turn, turn_sigma = _length(motion.value[:3], scatter[:3, :3])
    if is_explained < 1 or shift_sigma_m > options.vague_m or np.degrees(turn_sigma) > options.vague_deg:
        return replace(UNKNOWN, score=score)
    scan_shift_m = 0.0
    if of_scan is not None:
        scan_shift_m = float(np.linalg.norm(apparent_motion(equations).value[3:] - motion.value[3:]))
    return Agreement(
        score,
        offset_deg,
        shift_m,
        shift_sigma_m,
        float(np.degrees(turn)),
        float(np.degrees(turn_sigma)),
        scan_shift_m,
    )


def _length(vector: Floats, covariance: Floats) -> tuple[float, float]:
    """The length of a vector (3,) and its standard deviation along it."""
    length = float(np.linalg.norm(vector))
    along = vector / max(length, 1e-12)
    return length, float(np.sqrt(along @ covariance @ along))
