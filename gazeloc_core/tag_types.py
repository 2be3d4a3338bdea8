"""Tags as data: where frames saw them, and where their corners are in space.

Corner order, as the AprilTag library reports it (looking at the printed tag, x right, y down, z into the wall):

    3 ---- 2        0: (-s/2, +s/2)   1: (+s/2, +s/2)
    |      |        3: (-s/2, -s/2)   2: (+s/2, -s/2)
    0 ---- 1        s: the tag size, between the corners that the detector reports
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gazeloc_core.arrays import Bools, Floats, Ints, frozen


@dataclass(frozen=True, eq=False)
class TagSightings:
    """S sightings: `frame_index` (S,), `tag_id` (S,), `corners_px` (S, 4, 2), `decision_margin` (S,).

    Pixels are of the image that was searched: a phone frame as stored, a glasses frame undistorted.
    """

    frame_index: Ints
    tag_id: Ints
    corners_px: Floats
    decision_margin: Floats

    def __post_init__(self) -> None:
        object.__setattr__(self, "frame_index", frozen(self.frame_index, np.int64))
        object.__setattr__(self, "tag_id", frozen(self.tag_id, np.int64))
        object.__setattr__(self, "corners_px", frozen(np.reshape(self.corners_px, (-1, 4, 2))))
        object.__setattr__(self, "decision_margin", frozen(self.decision_margin))

    def __len__(self) -> int:
        return len(self.tag_id)

    def pick(self, which: Bools | Ints) -> TagSightings:
        """Some of the sightings, by mask (S,) or by rows."""
        return TagSightings(
            self.frame_index[which], self.tag_id[which], self.corners_px[which], self.decision_margin[which]
        )


@dataclass(frozen=True, eq=False)
class TagCorners:
    """T tags in one frame (`scan` in metres, or `sfm`): `tag_id` (T,), `corners` (T, 4, 3), what they rest on.

    `sightings` (T,) is how many frames were used, `spread` (T,) the RMS disagreement of the sightings,
    in the frame's units. `free_side` (T,) is the side that the sightings say where the printed size is not assumed,
    NaN where nobody asked: `corners` on the scan are of the printed size, whatever the scan's scale. `notes` are
    sentences for the user about tags that were left out.
    """

    tag_id: Ints
    corners: Floats
    sightings: Ints
    spread: Floats
    notes: tuple[str, ...] = ()
    free_side: Floats | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "tag_id", frozen(self.tag_id, np.int64))
        free_side = np.full(len(self.tag_id), np.nan) if self.free_side is None else self.free_side
        object.__setattr__(self, "free_side", frozen(free_side))
        object.__setattr__(self, "corners", frozen(np.reshape(self.corners, (-1, 4, 3))))
        object.__setattr__(self, "sightings", frozen(self.sightings, np.int64))
        object.__setattr__(self, "spread", frozen(self.spread))

    def __len__(self) -> int:
        return len(self.tag_id)

    def free_scale(self, size: float) -> float | None:
        """How large the tags come out where their printed `size` is not assumed, 1 for just as large; None: unknown.

        The median of the tags that say so.
        """
        sides = np.asarray(self.free_side)
        sides = sides[np.isfinite(sides)]
        return float(np.median(sides)) / size if len(sides) else None

    @property
    def centers(self) -> Floats:
        """The tag centres (T, 3): the crossing of the square's diagonals, which for a square is the corners' mean."""
        return np.asarray(self.corners.mean(axis=1), dtype=np.float64)
