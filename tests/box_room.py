"""A box room with furniture, tags and a reconstruction of it, as geometry only: known truth for tests, no pictures.

The room is 5 x 2.6 x 4 m, y up, walls subdivided so that noise makes them bumpy as a fused scan's.
"""

from dataclasses import dataclass

import numpy as np
import trimesh
from scipy.spatial.transform import RigidTransform, Rotation

from gazeloc_core.alignment.correspondences import Correspondences, gather
from gazeloc_core.camera import Camera
from gazeloc_core.keypoints import KeypointSet
from gazeloc_core.scan import Mesh
from gazeloc_core.sfm_model import SfmModel
from gazeloc_core.tag_types import TagCorners
from gazeloc_core.transforms import Similarity

SIZE = np.array([5.0, 2.6, 4.0])
TAG_SIZE_M = 0.16
CENTRE = np.zeros(3)
GLASSES = Camera(
    "FULL_OPENCV",
    1088,
    1080,
    np.array([766.0, 766.0, 543.0, 558.0, -0.126, 0.1, 0.0, 0.0, 0.02, 0.2, 0.15, 0.05]),
)
PINHOLE = Camera.pinhole(1088, 1080, 700.0, 700.0, 544.0, 540.0)
# Centre, outward axis of the wall the tag looks from, and the tag's x axis, all in the scan.
TAGS = {
    0: ((-2.5, 0.2, 0.5), (1, 0, 0), (0, 0, -1)),
    1: ((2.5, 0.4, -0.8), (-1, 0, 0), (0, 0, 1)),
    2: ((0.6, 0.1, -2.0), (0, 0, 1), (1, 0, 0)),
    3: ((-1.2, 0.5, 2.0), (0, 0, -1), (-1, 0, 0)),
    4: ((1.0, -1.3, 0.7), (0, 1, 0), (1, 0, 0)),
    5: ((-1.4, 0.7, -2.0), (0, 0, 1), (1, 0, 0)),
}
SFM_FROM_SCAN = Similarity(0.37, Rotation.from_rotvec([0.5, -1.1, 0.3]), np.array([1.0, -2.0, 0.5]))


@dataclass(frozen=True)
class Room:
    """The truth and what was made of it."""

    mesh: Mesh
    model: SfmModel
    scan_from_sfm: Similarity
    scan_from_camera: RigidTransform
    scan_tags: TagCorners
    sfm_tags: TagCorners

    @property
    def pairs(self) -> Correspondences:
        return gather(self.scan_tags, self.sfm_tags, KeypointSet())


def true_tag_corners() -> TagCorners:
    corners = []
    for centre, outward, right in TAGS.values():
        x, into = np.array(right, float), -np.array(outward, float)
        down = np.cross(into, x)
        offsets = np.array([(-1, 1), (1, 1), (1, -1), (-1, -1)]) * TAG_SIZE_M / 2
        corners.append([np.array(centre) + a * x + b * down for a, b in offsets])
    count = len(TAGS)
    return TagCorners(np.array(list(TAGS)), np.array(corners), np.full(count, 5), np.zeros(count))


def room_mesh(noise_m: float = 0.0, seed: int = 0) -> Mesh:
    parts = [trimesh.creation.box(SIZE)]
    for extents, place in (((1.2, 0.75, 0.7), (1.2, -0.925, -1.4)), ((0.6, 1.8, 0.4), (-2.1, -0.4, -1.2))):
        parts.append(trimesh.creation.box(extents, RigidTransform.from_translation(place).as_matrix()))
    whole = trimesh.util.concatenate(parts)
    vertices, faces = trimesh.remesh.subdivide_to_size(whole.vertices, whole.faces, 0.15)
    vertices = vertices + np.random.default_rng(seed).normal(0, noise_m, vertices.shape)
    return Mesh(vertices, faces)


def camera_poses(count: int, seed: int = 1) -> RigidTransform:
    """Poses of a head that walks through the room and looks around; x right, y down, z forward."""
    rng = np.random.default_rng(seed)
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    centres = np.column_stack([1.0 * np.cos(angle), 0.1 * rng.normal(size=count), 0.8 * np.sin(angle)])
    forward = np.column_stack([np.cos(angle + 0.6), 0.2 * rng.normal(size=count) - 0.1, np.sin(angle + 0.6)])
    forward /= np.linalg.norm(forward, axis=1, keepdims=True)
    right = np.cross(forward, (0.0, 1.0, 0.0))
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    axes = np.stack([right, np.cross(forward, right), forward], axis=2)
    return RigidTransform.from_components(centres, Rotation.from_matrix(axes))


def make_room(
    *,
    points: int = 4000,
    images: int = 40,
    point_noise_m: float = 0.0,
    mesh_noise_m: float = 0.0,
    tag_noise_m: float = 0.0,
    seed: int = 0,
) -> Room:
    rng = np.random.default_rng(seed)
    clean = room_mesh()
    surface = trimesh.Trimesh(clean.vertices, clean.faces, process=False)
    in_scan, _ = trimesh.sample.sample_surface(surface, points, seed=seed)
    in_scan = in_scan + rng.normal(0, point_noise_m, in_scan.shape)
    poses = camera_poses(images)
    sfm_poses = SFM_FROM_SCAN.compose_pose(poses)
    model = SfmModel(
        cameras={1: PINHOLE},
        image_names=tuple(f"frame_{i:06d}.png" for i in range(images)),
        image_camera_ids=np.ones(images, int),
        sfm_from_camera=sfm_poses,
        frame_indices=np.arange(images),
        points=SFM_FROM_SCAN.apply(in_scan),
        point_colors=np.full((points, 3), 120),
        point_errors_px=np.full(points, 0.5),
        track_lengths=np.full(points, 4),
        observation_point=np.zeros(0, int),
        observation_image=np.zeros(0, int),
        observation_px=np.zeros((0, 2)),
    )
    tags = true_tag_corners()
    shift = rng.normal(0, tag_noise_m, (len(tags), 1, 3))  # a tag's corners drift together
    scan_tags = TagCorners(tags.tag_id, tags.corners + shift, tags.sightings, tags.spread)
    sfm_tags = TagCorners(tags.tag_id, SFM_FROM_SCAN.apply(tags.corners), tags.sightings, tags.spread)
    return Room(room_mesh(mesh_noise_m, seed), model, SFM_FROM_SCAN.inverse(), poses, scan_tags, sfm_tags)


def pose_errors_of(room: Room, scan_from_sfm: Similarity) -> tuple[float, float]:
    """Mean error over the cameras of an alignment: position in metres, rotation in degrees."""
    found = scan_from_sfm.compose_pose(room.model.sfm_from_camera)
    position = np.linalg.norm(found.translation - room.scan_from_camera.translation, axis=1).mean()
    turn = np.rad2deg((found.rotation * room.scan_from_camera.rotation.inv()).magnitude()).mean()
    return float(position), float(turn)


def perturbed(scan_from_sfm: Similarity, shift_m: float, turn_deg: float, seed: int, centre=CENTRE) -> Similarity:
    """The alignment moved in the scan: a turn about `centre` and a shift, in random directions."""
    rng = np.random.default_rng(seed)
    axis, direction = (v / np.linalg.norm(v) for v in rng.normal(size=(2, 3)))
    turn = Rotation.from_rotvec(np.deg2rad(turn_deg) * axis)
    delta = Similarity(1.0, turn, centre - turn.as_matrix() @ centre + shift_m * direction)
    return delta * scan_from_sfm
