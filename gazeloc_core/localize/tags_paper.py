"""Poses of a recording's frames by the paper's recipe (method `tags-paper`; pipeline 1, branches a-b-c-f).

For a frame of the glasses and a frame of the phone that see the same tag, the two poses of the tag are chained:

    scan_from_camera = scan_from_phone · phone_from_tag · tag_from_camera

The paper leaves open which of several tags and of several phone frames it takes; it finds "frames matching by tracking
the common tag". Here it is the phone's first sighting of each tag, and of the tags in a glasses frame the one that the
detector is surest of (largest decision margin): one tag and one pair of frames, as in the paper, and no averaging.
Tag poses are those of AprilTag's own solver, the lower one of its two minima; the ambiguity is shown, not resolved.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import RigidTransform

from gazeloc_core.arrays import Bools, Floats, Ints
from gazeloc_core.camera import Camera
from gazeloc_core.errors import GeometryError, InputError
from gazeloc_core.localize.resection import CameraPoses, SeenSquares
from gazeloc_core.localize.tag_localization import (
    LocalizedFrames,
    TagLocalization,
    check_sightings,
    tag_localization,
    unmapped_note,
)
from gazeloc_core.progress import Report, silent
from gazeloc_core.scan import RoomScan
from gazeloc_core.tag_types import TagSightings
from gazeloc_core.tags.pose import TagPoses, apriltag_poses, checked_tag_size, normalised_corners
from gazeloc_core.tags.square import UNIT_SQUARE


@dataclass(frozen=True, kw_only=True)
class TagsPaperOptions:
    """When a frame is marked as ambiguous; it keeps its pose."""

    ambiguous_ratio: float = 0.5
    """Reprojection error of the pose that was taken over that of the tag's other one, above which they look alike."""


def localize_tags_paper(
    timestamp_ns: Ints,
    keyframes: Ints,
    camera: Camera,
    sightings: TagSightings,
    scan: RoomScan,
    scan_sightings: TagSightings,
    tag_size_m: float | None,
    options: TagsPaperOptions | None = None,
    report: Report = silent,
) -> TagLocalization:
    """The poses of a recording with times (N,): `tag_only` where a frame shows a tag that the phone saw, else `none`.

    `camera` is the pinhole camera of the `sightings`; `scan_sightings` count `scan.frames_with_images`. A frame whose
    tag has corners that are no picture of a square is `rejected`.

    Raises:
        InputError: if the tag size is not given or impossible.
        GeometryError: if sightings or keyframes are not of this recording or scan.
        Cancelled: when `report` raises it.
    """
    options = options or TagsPaperOptions()
    if tag_size_m is None:
        raise InputError(
            "The method tags-paper needs the tag size; measure a tag and give it with --tag-size in metres."
        )
    size = checked_tag_size(tag_size_m)
    times = np.asarray(timestamp_ns, dtype=np.int64)
    check_sightings(sightings, len(times))
    report(0.0, "Solving for the tags' poses in the phone's frames")
    tags = _first_places(scan, scan_sightings, size)
    report(0.3, "Solving for the tags' poses in the glasses' frames")
    tag = tags.rows_of(sightings.tag_id)
    mapped = np.flatnonzero(tag >= 0)
    poses = apriltag_poses(sightings.corners_px[mapped], camera, size)
    shown = np.unique(sightings.frame_index[mapped])
    best = _surest(sightings.frame_index[mapped], sightings.decision_margin[mapped])
    best = best[np.isfinite(poses.rms_px[best, 0])]
    found = _chained(best, poses, tags, tag[mapped], sightings, mapped, camera, size)
    ratio = np.maximum(_ratio(poses)[best], tags.ratio[tag[mapped[best]]])
    notes = unmapped_note(sightings, tags.tag_id)
    report(1.0, " ".join(notes) or f"{len(found.frame)} frames localised by tags")
    return tag_localization(
        times,
        keyframes,
        found,
        np.setdiff1d(shown, found.frame),
        found.frame[ratio > options.ambiguous_ratio],
        notes,
    )


@dataclass(frozen=True, eq=False)
class _Places:
    """T tags by rising `tag_id` (T,): `rotation` (T, 3, 3) and `center` (T, 3) of `scan_from_tag`, `ratio` (T,)."""

    tag_id: Ints
    rotation: Floats
    center: Floats
    ratio: Floats

    def rows_of(self, tag_ids: Iterable[int]) -> Ints:
        """The row of each tag (S,), -1 for those without place."""
        row_of = {tag_id: row for row, tag_id in enumerate(self.tag_id.tolist())}
        return np.array([row_of.get(int(tag_id), -1) for tag_id in tag_ids], dtype=np.int64)


def _first_places(scan: RoomScan, sightings: TagSightings, size_m: float) -> _Places:
    """Where the first phone frame that shows a tag puts it; tags whose corners there are no square have no place."""
    frames = scan.frames_with_images
    if len(sightings) and sightings.frame_index.max() >= len(frames):
        raise GeometryError(
            f"A tag was seen in phone frame {int(sightings.frame_index.max())}, but {scan.path} has {len(frames)} "
            "frames with pictures; find the tags again."
        )
    in_time = np.argsort(sightings.frame_index, kind="stable")
    tag_id, first = np.unique(sightings.tag_id[in_time], return_index=True)
    rows = in_time[first]
    phone = [frames[i] for i in sightings.frame_index[rows].tolist()]
    poses = apriltag_poses(sightings.corners_px[rows], [frame.camera for frame in phone], size_m)
    good = np.flatnonzero(np.isfinite(poses.rms_px[:, 0]))
    if len(good) == 0:
        return _Places(tag_id[good], np.empty((0, 3, 3)), np.empty((0, 3)), np.empty(0))
    scan_from_phone = RigidTransform.concatenate([phone[i].scan_from_camera for i in good])
    turn = scan_from_phone.rotation.as_matrix()
    center = np.einsum("tij,tj->ti", turn, poses.translation[good, 0]) + scan_from_phone.translation
    return _Places(tag_id[good], turn @ poses.rotation[good, 0], center, _ratio(poses)[good])


def _ratio(poses: TagPoses) -> Floats:
    """(S,) the error of the pose that was taken over that of the other; 0 where there is no other."""
    return np.nan_to_num(poses.rms_px[:, 0] / np.maximum(poses.rms_px[:, 1], 1e-12), nan=0.0)


def _surest(frame: Ints, margin: Floats) -> Ints:
    """The sighting with the largest decision margin of each frame, by rising frame."""
    order = np.lexsort((-margin, frame))
    return np.asarray(order[np.unique(frame[order], return_index=True)[1]])


def _chained(
    best: Ints,
    poses: TagPoses,
    tags: _Places,
    tag: Ints,
    sightings: TagSightings,
    mapped: Ints,
    camera: Camera,
    size_m: float,
) -> LocalizedFrames:
    """The poses by the sightings `best` (K,) of the `mapped` ones, and all mapped tags of their frames as views."""
    turn = tags.rotation[tag[best]] @ poses.rotation[best, 0].transpose(0, 2, 1)
    center = tags.center[tag[best]] - np.einsum("kij,kj->ki", turn, poses.translation[best, 0])
    frame = sightings.frame_index[mapped]
    pose_of = {index: k for k, index in enumerate(frame[best].tolist())}
    pose = np.array([pose_of.get(index, -1) for index in frame.tolist()], dtype=np.int64)
    order = np.argsort(pose, kind="stable")
    order = order[pose[order] >= 0]
    square = np.column_stack([UNIT_SQUARE * size_m, np.zeros(4)])
    corners = np.einsum("tij,cj->tci", tags.rotation, square) + tags.center[:, None]
    is_used: Bools = np.isin(order, best)
    normalised = normalised_corners(sightings.corners_px[mapped[order]], camera)
    views = SeenSquares(pose[order], corners[tag[order]], normalised, camera.focal_px, is_used)
    return LocalizedFrames(frame[best], CameraPoses(center, turn), views, is_used)
