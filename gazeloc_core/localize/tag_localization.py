"""What the methods that localise by tags alone return: the poses, and how well the tags agree with them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gazeloc_core.arrays import Bools, Floats, Ints, frozen
from gazeloc_core.errors import GeometryError
from gazeloc_core.localize.resection import CameraPoses, SeenSquares, distances_m, errors_px
from gazeloc_core.localize.sfm import frame_mask
from gazeloc_core.tag_types import TagSightings
from gazeloc_core.trajectory import PoseStatus, Trajectory
from gazeloc_core.transforms import rigid, rotation_from_matrix


@dataclass(frozen=True, eq=False)
class TagLocalization:
    """The trajectory, sentences for the user, and columns over the N frames of the recording.

    `tags_used` (N,) how many tags the pose rests on; `rms_px` (N,) their corners' reprojection error;
    `disagreement_m` (N,) how far the worst of all mapped tags in the frame, used or not, is seen from its place, at its
    own distance; `is_ambiguous` (N,) whether the tag's two poses could not be told apart. NaN without pose.
    """

    trajectory: Trajectory
    notes: tuple[str, ...]
    tags_used: Ints
    rms_px: Floats
    disagreement_m: Floats
    is_ambiguous: Bools

    def __post_init__(self) -> None:
        columns = {"tags_used": np.int64, "rms_px": np.float64, "disagreement_m": np.float64, "is_ambiguous": np.bool_}
        for name, kind in columns.items():
            column = frozen(getattr(self, name), kind)
            if len(column) != len(self.trajectory):
                raise GeometryError(f"There are {len(self.trajectory)} frames but {len(column)} rows of {name}.")
            object.__setattr__(self, name, column)


@dataclass(frozen=True, eq=False)
class LocalizedFrames:
    """K frames (`frame` (K,) rising) with poses, and the V views of mapped tags in them, by pose.

    `is_used` (V,) the views that the poses rest on.
    """

    frame: Ints
    poses: CameraPoses
    views: SeenSquares
    is_used: Bools

    def pick(self, which: Bools) -> LocalizedFrames:
        """Some of the frames, with their views."""
        mine = which[self.views.pose]
        number = np.cumsum(which) - 1
        views = self.views.pick(mine)
        return LocalizedFrames(
            self.frame[which], self.poses[which], replace(views, pose=number[views.pose]), self.is_used[mine]
        )


def tag_localization(
    timestamp_ns: Ints,
    keyframes: Ints,
    found: LocalizedFrames,
    rejected: Ints,
    ambiguous: Ints,
    notes: tuple[str, ...],
) -> TagLocalization:
    """The result for all N frames: `tag_only` where found, `rejected` at these frames, `none` elsewhere.

    Raises:
        GeometryError: if the keyframes are not of this recording.
    """
    times = np.asarray(timestamp_ns, dtype=np.int64)
    count, frame, views = len(times), found.frame, found.views
    status = np.full(count, PoseStatus.NONE.value, dtype="U16")
    status[rejected] = PoseStatus.REJECTED.value
    status[frame] = PoseStatus.TAG_ONLY.value
    poses = None
    if len(frame):
        poses = rigid(rotation_from_matrix(found.poses.rotations, "a tag's pose"), found.poses.centers, "a tag's pose")
    is_keyframe = frame_mask(np.asarray(keyframes, dtype=np.int64), count, "keyframes")
    used = np.bincount(views.pose[found.is_used], minlength=len(frame))
    squared = np.mean(np.sum(errors_px(views, found.poses) ** 2, axis=2), axis=1)
    total = np.bincount(views.pose, np.where(found.is_used, squared, 0.0), minlength=len(frame))
    worst = np.zeros(len(frame))
    np.maximum.at(worst, views.pose, distances_m(views, found.poses))
    columns = {"used": np.zeros(count), "rms": np.full(count, np.nan), "worst": np.full(count, np.nan)}
    columns["used"][frame] = used
    columns["rms"][frame] = np.sqrt(total / np.maximum(used, 1))
    columns["worst"][frame] = worst
    is_ambiguous = np.zeros(count, dtype=np.bool_)
    is_ambiguous[ambiguous] = True
    trajectory = Trajectory.from_poses(times, status, is_keyframe, frame, poses)
    return TagLocalization(
        trajectory, notes, columns["used"].astype(np.int64), columns["rms"], columns["worst"], is_ambiguous
    )


def check_sightings(sightings: TagSightings, count: int) -> None:
    """Refuse sightings in frames that a recording of `count` frames does not have.

    Raises:
        GeometryError: with the frame.
    """
    index = sightings.frame_index
    if len(index) and (index.min() < 0 or index.max() >= count):
        raise GeometryError(
            f"A tag was seen in frame {int(index.max())}, but the recording has {count} frames; "
            "check that the tags were searched in this recording."
        )


def unmapped_note(sightings: TagSightings, mapped: Ints) -> tuple[str, ...]:
    """A sentence about tags that the glasses see but that have no place on the scan, if there are any."""
    missing = sorted(set(sightings.tag_id.tolist()) - set(mapped.tolist()))
    if not missing:
        return ()
    names = ", ".join(str(tag_id) for tag_id in missing)
    which = f"Tag {names} is" if len(missing) == 1 else f"Tags {names} are"
    return (f"{which} seen by the glasses but not on the scan.",)
