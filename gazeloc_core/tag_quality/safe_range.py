"""The safe range of a tag (the paper, section IX): from where it is found, and its pose is right enough.

A tag is drawn many times (`synthesis/one_tag.py`), searched by the real detector and solved by `tags/pose.py`. Rotating
at a constant distance and receding at a constant angle, the paper's two experiments, are the columns and the rows of
one grid. Its axes are the viewing angle and the *pixels per tag*, f · size / distance: what a tag that is looked at
straight measures in the picture. In these and in errors counted in tag sizes the answer holds for every tag size; the
focal length matters little (it sets how strong the perspective is at a given number of pixels).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from gazeloc_core.arrays import Bools, Floats, frozen
from gazeloc_core.camera import Camera
from gazeloc_core.errors import InputError
from gazeloc_core.progress import Report, silent
from gazeloc_core.synthesis.one_tag import SightOptions, tag_sight
from gazeloc_core.tags.bitmaps import TagBitmap, tag_bitmap
from gazeloc_core.tags.detection import TagDetector, TagOptions
from gazeloc_core.tags.pose import checked_tag_size, tag_poses
from gazeloc_core.transforms import rotation_angle_rad

_SIZE_M = 0.16  # any: all is counted in tag sizes
_PICTURE_PX = 1300
_ASIDE_DEG = 12.0
TRIALS_VERSION = 1
"""Goes up whenever the same options give other numbers, so that what was kept of before is not taken for them."""


@dataclass(frozen=True, kw_only=True)
class SafeRangeOptions:
    """The grid of views, and what the pictures suffer from."""

    pixels: tuple[float, ...] = (14, 17, 20, 24, 28, 33, 40, 48, 57, 68, 81, 96, 115, 160)
    """Pixels per tag, rising."""
    angles_deg: tuple[float, ...] = (0, 10, 20, 30, 40, 50, 60, 70, 80)
    """Viewing angles between the tag's normal and the line of sight, rising."""
    repeats: int = 20
    """Pictures per place in the grid, each with its own direction of tilt, roll, id, motion and noise."""
    focal_px: float = 766.0
    """Focal length in pixels; the default is Pupil Invisible's."""
    sight: SightOptions = field(default_factory=SightOptions)
    """What the pictures suffer from."""
    detection: TagOptions = field(default_factory=lambda: TagOptions(threads=1))
    """The family and how it is searched."""
    seed: int = 1
    """Seed of everything random."""


@dataclass(frozen=True, kw_only=True)
class SafeLimits:
    """What makes a range safe. The defaults are the aims for localising frames by tags."""

    detection_rate: float = 0.9
    """Least share of the pictures in which the tag is found."""
    position_m: float = 0.08
    """Largest mean error of the camera's place, as the tag gives it."""
    rotation_deg: float = 2.0
    """Largest mean error of the camera's rotation."""


@dataclass(frozen=True, eq=False)
class TagTrials:
    """N pictures: `pixels` (N,), `angle_deg` (N,), `is_found` (N,) whether the detector found the tag (and no other).

    Of both poses, that with the lower reprojection error first, NaN where there is none: `position_error_sizes` (N, 2),
    how far the camera is put from where it was in the tag's frame, in tag sizes; `rotation_error_deg` (N, 2).
    `ratio` (N,) is the lower reprojection error over the higher: near 1 the two cannot be told apart.
    """

    pixels: Floats
    angle_deg: Floats
    is_found: Bools
    position_error_sizes: Floats
    rotation_error_deg: Floats
    ratio: Floats

    def __post_init__(self) -> None:
        for name in vars(self):
            object.__setattr__(self, name, frozen(getattr(self, name), getattr(self, name).dtype))


@dataclass(frozen=True, eq=False)
class TagQuality:
    """What single tags are worth by `pixels` (P,) and `angle_deg` (A,); all else (P, A), NaN where none was found.

    `detection_rate`; of the first pose the means `position_error_sizes` and `rotation_error_deg`, and their medians;
    `ambiguous_share` of the sightings whose two poses differ by less than `ambiguous_ratio` in their errors,
    `flipped_share` of those whose second pose is right by 5° more than their first.
    """

    pixels: Floats
    angle_deg: Floats
    detection_rate: Floats
    position_error_sizes: Floats
    rotation_error_deg: Floats
    position_median_sizes: Floats
    rotation_median_deg: Floats
    ambiguous_share: Floats
    flipped_share: Floats

    def __post_init__(self) -> None:
        for name in vars(self):
            object.__setattr__(self, name, frozen(getattr(self, name)))


FLIPPED_DEG = 5.0


def try_tags(options: SafeRangeOptions | None = None, report: Report = silent) -> TagTrials:
    """Draw, search and solve a tag at every place of the grid; the same options give the same numbers.

    Raises:
        InputError: if the grid is empty, does not rise, or asks for impossible views, or the family is unknown.
        Cancelled: when `report` raises it.
    """
    options = options or SafeRangeOptions()
    _check(options)
    camera = Camera.pinhole(
        _PICTURE_PX, _PICTURE_PX, options.focal_px, options.focal_px, _PICTURE_PX / 2, _PICTURE_PX / 2
    )
    bitmaps = [tag_bitmap(options.detection.family, tag_id) for tag_id in range(min(30, options.repeats))]
    grid = [(px, angle) for px in options.pixels for angle in options.angles_deg]
    rows: list[tuple[float, ...]] = []
    with TagDetector(options.detection) as detector:
        for done, (pixels, angle) in enumerate(grid):
            report(done / len(grid), f"Looking at tags of {pixels:g} pixels from {angle:g} degrees")
            for repeat in range(options.repeats):
                rng = np.random.default_rng([options.seed, done, repeat])
                tag_id = repeat % len(bitmaps)
                seen = _one_look(detector, tag_id, bitmaps[tag_id], camera, pixels, angle, options.sight, rng)
                rows.append((pixels, angle, *seen))
    report(1.0, f"Looked at {len(rows)} tags")
    table = np.array(rows)
    return TagTrials(table[:, 0], table[:, 1], table[:, 2] > 0, table[:, 3:5], table[:, 5:7], table[:, 7])


def tag_quality(trials: TagTrials, ambiguous_ratio: float = 0.5) -> TagQuality:
    """The trials summed up by their place in the grid."""
    pixels, row = np.unique(trials.pixels, return_inverse=True)
    angles, column = np.unique(trials.angle_deg, return_inverse=True)
    position, rotation = trials.position_error_sizes, trials.rotation_error_deg
    is_flipped = rotation[:, 1] < rotation[:, 0] - FLIPPED_DEG  # NaN is not
    measures = [name for name in TagQuality.__dataclass_fields__ if name not in ("pixels", "angle_deg")]
    table = {name: np.full((len(pixels), len(angles)), np.nan) for name in measures}
    for at in np.ndindex(len(pixels), len(angles)):
        here = (row == at[0]) & (column == at[1])
        found = here & trials.is_found & np.isfinite(rotation[:, 0])
        table["detection_rate"][at] = found.sum() / here.sum() if here.any() else np.nan
        if found.any():
            table["position_error_sizes"][at] = position[found, 0].mean()
            table["rotation_error_deg"][at] = rotation[found, 0].mean()
            table["position_median_sizes"][at] = np.median(position[found, 0])
            table["rotation_median_deg"][at] = np.median(rotation[found, 0])
            table["ambiguous_share"][at] = (trials.ratio[found] > ambiguous_ratio).mean()
            table["flipped_share"][at] = is_flipped[found].mean()
    return TagQuality(pixels, angles, **table)


def safe_cells(quality: TagQuality, tag_size_m: float, limits: SafeLimits | None = None) -> Bools:
    """(P, A) where tags of this size are safe: there, and at every larger number of pixels from the same angle.

    Raises:
        InputError: if the tag size is impossible.
    """
    limits, size = limits or SafeLimits(), checked_tag_size(tag_size_m)
    good = quality.detection_rate >= limits.detection_rate
    good &= quality.position_error_sizes * size <= limits.position_m
    good &= quality.rotation_error_deg <= limits.rotation_deg
    return np.asarray(np.logical_and.accumulate(good[::-1], axis=0)[::-1])


def least_safe_pixels(quality: TagQuality, tag_size_m: float, limits: SafeLimits | None = None) -> Floats:
    """(A,) from how many pixels per tag on a tag of this size is safe, by angle; NaN where it never is."""
    safe = safe_cells(quality, tag_size_m, limits)
    return np.where(safe.any(axis=0), quality.pixels[safe.argmax(axis=0)], np.nan)


def is_in_safe_range(quality: TagQuality, safe: Bools, pixels: Floats, angle_deg: Floats) -> Bools:
    """Whether views (S,) lie in the `safe` cells (P, A): the next lower number of pixels, and both angles around.

    NaN and views below the grid or beyond its angles do not; more pixels than the grid's largest count as those.
    """
    row = np.searchsorted(quality.pixels, np.nan_to_num(pixels), side="right") - 1
    upper = np.searchsorted(quality.angle_deg, angle_deg)  # NaN comes last
    lower = np.searchsorted(quality.angle_deg, angle_deg, side="right") - 1
    known = (row >= 0) & (lower >= 0) & (upper < len(quality.angle_deg))
    row, lower, upper = (np.where(known, index, 0) for index in (row, lower, upper))
    return np.asarray(known & safe[row, lower] & safe[row, upper])


def _check(options: SafeRangeOptions) -> None:
    pixels, angles = np.array(options.pixels, dtype=float), np.array(options.angles_deg, dtype=float)
    if options.repeats < 1 or len(pixels) == 0 or len(angles) == 0:
        raise InputError("The safe range needs at least one number of pixels, one angle and one repeat.")
    if not ((np.diff(pixels) > 0).all() and pixels[0] >= 4 and pixels[-1] <= options.focal_px):
        raise InputError(f"The pixels per tag {options.pixels} must rise, from 4 to the focal length at most.")
    if not ((np.diff(angles) > 0).all() and angles[0] >= 0 and angles[-1] <= 85):
        raise InputError(f"The viewing angles {options.angles_deg} must rise, from 0 to 85 degrees at most.")


def _one_look(
    detector: TagDetector,
    tag_id: int,
    bitmap: TagBitmap,
    camera: Camera,
    pixels: float,
    angle_deg: float,
    sight: SightOptions,
    rng: np.random.Generator,
) -> tuple[float, float, float, float, float, float]:
    """Whether the tag was found, then position errors and rotation errors of both poses, and the ratio."""
    camera_from_tag = _view(camera.focal_px[0] * _SIZE_M / pixels, angle_deg, rng)
    shown = tag_sight(bitmap, camera, camera_from_tag, _SIZE_M, rng, sight)
    seen = detector.detect(shown.image)
    if seen.tag_id.tolist() != [tag_id]:
        return 0.0, np.nan, np.nan, np.nan, np.nan, np.nan
    poses = tag_poses(seen.corners_px + shown.offset_px, camera, _SIZE_M)
    place = camera_from_tag.inv().translation
    errors = [(np.nan, np.nan)] * 2
    for k in np.flatnonzero(np.isfinite(poses.rms_px[0])).tolist():
        found = poses.camera_from_tag(0, k)
        off = float(np.linalg.norm(found.inv().translation - place)) / _SIZE_M
        errors[k] = off, float(np.degrees(rotation_angle_rad(found.rotation, camera_from_tag.rotation)))
    (first, turned), (second, other) = errors
    return 1.0, first, second, turned, other, float(poses.ratio[0])


def _view(distance_m: float, angle_deg: float, rng: np.random.Generator) -> RigidTransform:
    """`camera_from_tag` at a distance and viewing angle; direction of tilt, roll and place in the picture at random."""
    aside = Rotation.from_rotvec(np.radians(_ASIDE_DEG) * np.append(rng.uniform(-1, 1, 2), 0))
    sight = aside.as_matrix()[:, 2]
    azimuth, roll = rng.uniform(0, 2 * np.pi), rng.uniform(-np.pi, np.pi)
    tilt = Rotation.from_rotvec(np.radians(angle_deg) * np.array([np.cos(azimuth), np.sin(azimuth), 0]))
    return RigidTransform.from_components(distance_m * sight, aside * tilt * Rotation.from_rotvec([0, 0, roll]))
