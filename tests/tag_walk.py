"""A walk with glasses through the box room, and what they see of its tags; exact truth, no pictures."""

from dataclasses import dataclass

import numpy as np
from box_room import PINHOLE, TAG_SIZE_M, true_tag_corners
from scipy.spatial.transform import RigidTransform, Rotation

from gazeloc_core.tag_types import TagCorners, TagSightings

START_NS = 1_712_000_000_123_456_789
LEAST_SIDE_PX = 15
MOST_OBLIQUE_DEG = 65


@dataclass(frozen=True)
class Walk:
    """N frames: when, from where, and the sightings of tags in them."""

    timestamp_ns: np.ndarray
    truth: RigidTransform
    sightings: TagSightings

    @property
    def shown(self) -> np.ndarray:
        """The frames that show a tag, rising."""
        return np.unique(self.sightings.frame_index)

    def without(self, rows: np.ndarray) -> "Walk":
        """The same walk, these sightings not made."""
        return Walk(self.timestamp_ns, self.truth, pick(self.sightings, ~np.isin(np.arange(len(self.sightings)), rows)))


def pick(sightings: TagSightings, which: np.ndarray) -> TagSightings:
    return TagSightings(*(getattr(sightings, name)[which] for name in vars(sightings)))


def walk(seconds: float = 8.0, hz: float = 30.0, noise_px: float = 0.0, edge_px: float = 0.0, seed: int = 0) -> Walk:
    """Once around the middle of the room, looking at the walls and a little up and down."""
    time = np.arange(round(seconds * hz)) / hz
    angle = 2 * np.pi * time / seconds
    centres = np.column_stack([0.8 * np.cos(angle), 0.2 + 0.03 * np.sin(2 * np.pi * 1.8 * time), 0.6 * np.sin(angle)])
    heading = angle + 0.4 * np.sin(2 * angle)
    pitch = 0.15 * np.sin(3 * angle)
    forward = np.column_stack([np.cos(pitch) * np.cos(heading), np.sin(pitch), np.cos(pitch) * np.sin(heading)])
    right = np.cross(forward, (0.0, 1.0, 0.0))
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    axes = np.stack([right, np.cross(forward, right), forward], axis=2)
    truth = RigidTransform.from_components(centres, Rotation.from_matrix(axes))
    return Walk(START_NS + np.round(time * 1e9).astype(np.int64), truth, see(truth, noise_px, edge_px, seed))


def see(
    poses: RigidTransform, noise_px: float = 0.0, edge_px: float = 0.0, seed: int = 0, tags: TagCorners | None = None
) -> TagSightings:
    """The tags of the room that cameras at these poses see: from the front, whole, and large enough."""
    tags, rng = tags or true_tag_corners(), np.random.default_rng(seed)
    frame, tag_id, pixels, margin = [], [], [], []
    for index in range(len(poses)):
        for name, corners in zip(tags.tag_id.tolist(), tags.corners, strict=True):
            local = poses[index].inv().apply(corners)
            if local[:, 2].min() < 0.2:
                continue
            seen = PINHOLE.project(local)
            into_wall, ray = np.cross(local[1] - local[0], local[0] - local[3]), local.mean(axis=0)
            facing = into_wall @ ray / np.linalg.norm(into_wall) / np.linalg.norm(ray)
            side = np.linalg.norm(seen - np.roll(seen, 1, axis=0), axis=1).min()
            if (
                not PINHOLE.contains(seen).all()
                or side < LEAST_SIDE_PX
                or facing < np.cos(np.radians(MOST_OBLIQUE_DEG))
            ):
                continue
            outward = seen - seen.mean(axis=0)
            outward *= np.sqrt(2) / np.linalg.norm(outward, axis=1, keepdims=True)
            frame.append(index)
            tag_id.append(name)
            pixels.append(seen - edge_px * outward + rng.normal(0, noise_px, (4, 2)))
            margin.append(side)
    return TagSightings(np.array(frame, int), np.array(tag_id, int), np.array(pixels), np.array(margin))


def errors(found: RigidTransform, truth: RigidTransform) -> tuple[np.ndarray, np.ndarray]:
    """Distances of the centres in metres and angles in degrees."""
    turn = (truth.rotation.inv() * found.rotation).magnitude()
    return np.linalg.norm(found.translation - truth.translation, axis=-1), np.degrees(turn)


__all__ = ["PINHOLE", "TAG_SIZE_M", "Walk", "errors", "pick", "see", "true_tag_corners", "walk"]
