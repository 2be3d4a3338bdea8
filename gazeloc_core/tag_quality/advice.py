"""Which tag size, and how many tags, a room needs: the safe range of a tag (`safe_range.py`) turned into advice.

The room of the second answer is plain: a rectangle with tags spread evenly along its walls at the height of the eyes,
and a wearer who stands and looks anywhere, level. Nothing hides a tag. Furnished rooms need more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gazeloc_core.arrays import Bools, Floats, Ints, frozen
from gazeloc_core.errors import InputError
from gazeloc_core.tag_quality.safe_range import SafeLimits, TagQuality, is_in_safe_range, safe_cells


@dataclass(frozen=True, kw_only=True)
class RoomOptions:
    """A room, a camera, and what is asked about them."""

    width_m: float
    """Length of one pair of walls."""
    length_m: float
    """Length of the other pair."""
    focal_px: float = 766.0
    """Focal length in pixels; the default is Pupil Invisible's."""
    view_deg: float = 82.0
    """Horizontal field of view of the camera."""
    sizes_m: tuple[float, ...] = (0.08, 0.10, 0.12, 0.14, 0.16, 0.20, 0.24)
    """Tag sizes to compare."""
    counts: tuple[int, ...] = (4, 6, 8, 10, 12, 16, 20, 24)
    """Numbers of tags to compare."""
    wall_distance_m: float = 0.5
    """How near the wearer comes to a wall."""
    views: int = 4000
    """Random places and directions of the wearer."""
    seed: int = 1
    """Seed of these."""


@dataclass(frozen=True, eq=False)
class SizeMap:
    """By `distance_m` (D,) and `size_m` (S,): `pixels` (D, S) per tag, `is_safe` (D, S) from some angle, and
    `widest_deg` (D, S), the largest viewing angle at which a tag is safe there, NaN where none is."""

    distance_m: Floats
    size_m: Floats
    pixels: Floats
    is_safe: Bools
    widest_deg: Floats

    def __post_init__(self) -> None:
        for name in vars(self):
            object.__setattr__(self, name, frozen(getattr(self, name), getattr(self, name).dtype))


@dataclass(frozen=True, eq=False)
class RoomMap:
    """By `count` (C,) of tags and `size_m` (S,): `share_safe` (C, S) of the views that see a tag in its safe range."""

    count: Ints
    size_m: Floats
    share_safe: Floats

    def __post_init__(self) -> None:
        object.__setattr__(self, "count", frozen(self.count, np.int64))
        object.__setattr__(self, "size_m", frozen(self.size_m))
        object.__setattr__(self, "share_safe", frozen(self.share_safe))


def size_map(
    quality: TagQuality, focal_px: float, distance_m: Floats, size_m: Floats, limits: SafeLimits | None = None
) -> SizeMap:
    """Which tag sizes are safe at which distances, for a camera of this focal length.

    Raises:
        InputError: if a distance, a size or the focal length is not above 0.
    """
    distances, sizes = np.asarray(distance_m, dtype=np.float64), np.asarray(size_m, dtype=np.float64)
    if not ((distances > 0).all() and (sizes > 0).all() and focal_px > 0):
        raise InputError("Distances, tag sizes and the focal length must be above 0.")
    pixels = focal_px * sizes[None] / distances[:, None]
    widest = np.full(pixels.shape, np.nan)
    for k, size in enumerate(sizes.tolist()):
        safe = safe_cells(quality, size, limits)
        for angle in quality.angle_deg.tolist():  # rising, so that the last one stays
            inside = is_in_safe_range(quality, safe, pixels[:, k], np.full(len(distances), angle))
            widest[inside, k] = angle
    return SizeMap(distances, sizes, pixels, np.isfinite(widest), widest)


def room_map(quality: TagQuality, options: RoomOptions, limits: SafeLimits | None = None) -> RoomMap:
    """How often a wearer sees at least one tag in its safe range, by number and size of tags.

    Raises:
        InputError: if the room is too small to stand in, or nothing is asked.
    """
    inner = np.array([options.width_m, options.length_m]) - 2 * options.wall_distance_m
    if not (inner > 0).all() or not options.sizes_m or not options.counts or min(options.counts) < 1:
        raise InputError(
            f"A room of {options.width_m:g} x {options.length_m:g} m with tags {options.sizes_m} x {options.counts} "
            "cannot be answered; give walls longer than 1 m, sizes and counts."
        )
    rng = np.random.default_rng(options.seed)
    place = options.wall_distance_m + rng.uniform(0, 1, (options.views, 2)) * inner
    heading, start = rng.uniform(-np.pi, np.pi, options.views), rng.uniform(0, 1, options.views)
    share = np.zeros((len(options.counts), len(options.sizes_m)))
    for row, count in enumerate(options.counts):
        distance, angle, in_view = _seen_tags(options, count, place, heading, start)
        for column, size in enumerate(options.sizes_m):
            pixels = options.focal_px * size / distance
            safe = is_in_safe_range(quality, safe_cells(quality, size, limits), pixels.ravel(), angle.ravel())
            share[row, column] = (in_view & safe.reshape(in_view.shape)).any(axis=1).mean()
    return RoomMap(np.array(options.counts), np.array(options.sizes_m), share)


def _seen_tags(
    options: RoomOptions, count: int, place: Floats, heading: Floats, start: Floats
) -> tuple[Floats, Floats, Bools]:
    """Of V views and `count` tags: distance (V, count), viewing angle in degrees, and whether it is in the picture.

    The tags begin anywhere along the walls, `start` (V,) as a share of the space between two.
    """
    along = (start[:, None] + np.arange(count)) / count * 2 * (options.width_m + options.length_m)
    tag, normal = _on_walls(along, options.width_m, options.length_m)
    sight = tag - place[:, None]
    distance = np.linalg.norm(sight, axis=2)
    cosine = -np.sum(sight * normal, axis=2) / distance
    bearing = np.arctan2(sight[..., 1], sight[..., 0]) - heading[:, None]
    off_axis = np.abs((bearing + np.pi) % (2 * np.pi) - np.pi)
    return distance, np.degrees(np.arccos(np.clip(cosine, -1, 1))), off_axis < np.radians(options.view_deg) / 2


def _on_walls(along: Floats, width: float, length: float) -> tuple[Floats, Floats]:
    """Points (..., 2) at lengths (...) along the walls, counter-clockwise from the origin; normals into the room."""
    corners = np.array([[0, 0], [width, 0], [width, length], [0, length]], dtype=float)
    steps = np.array([[1, 0], [0, 1], [-1, 0], [0, -1]], dtype=float)
    begins = np.array([0, width, width + length, 2 * width + length])
    wall = np.searchsorted(begins, along, side="right") - 1
    point = corners[wall] + steps[wall] * (along - begins[wall])[..., None]
    return point, np.stack([-steps[wall][..., 1], steps[wall][..., 0]], axis=-1)
