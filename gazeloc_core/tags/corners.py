"""Where tag corners are in space: on the scan from the phone's posed frames, in the reconstruction by triangulation.

On the scan two sources of different faults are joined. *Mesh*: each sighting casts rays through the inside of the tag,
fits a plane to the hits and meets it with the rays of the corners; one sighting is enough, but the mesh is noisy and
holed. *Rays*: the corner rays of all sightings are triangulated; needs parallax and suffers from the drift of the
phone's poses. Per tag both are averaged by their inverse variances, and a square is fitted. Where the printed size is
known, the one length in the room that is known exactly, all tags and phone poses are then adjusted together
(`bundle.py`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import RigidTransform

from gazeloc_core.arrays import Bools, Floats, Ints
from gazeloc_core.camera import Camera
from gazeloc_core.errors import InputError
from gazeloc_core.progress import Report, silent
from gazeloc_core.scan import RoomScan
from gazeloc_core.sfm_model import SfmModel
from gazeloc_core.surfaces.raycast import Raycaster
from gazeloc_core.tag_types import TagCorners, TagSightings
from gazeloc_core.tags.bundle import TagBundleOptions, TagScene, adjust_tags
from gazeloc_core.tags.square import fit_plane, fit_square, inside_of_tag_px, side_of
from gazeloc_core.triangulation import (
    Observations,
    TriangulatedPoints,
    TriangulationOptions,
    triangulate,
)

_IN_TWO_PLACES = "is seen in two places; left out, print each id once"
_SPLIT_SHARE = 0.3
_HUBER_ROUNDS = 20


@dataclass(frozen=True, kw_only=True)
class ScanCornerOptions:
    """How tags are put onto the scan."""

    rays_per_side: int = 7
    """Rays are cast on a grid of this many by this many inside of each sighting."""
    least_hits: float = 0.6
    """Share of these rays that must meet the mesh."""
    max_plane_rms_m: float = 0.03
    """Sightings whose hits are further from a plane than this have no place on the mesh."""
    max_incidence_deg: float = 75.0
    """Sightings more oblique than this have no place on the mesh."""
    agree_m: float = 0.06
    """Sightings within this distance of their tag's middle place agree; the others are dropped."""
    pose_error_m: float = 0.01
    """What the phone's positions are assumed to be off by; with the next one it weighs near and far sightings."""
    pose_error_deg: float = 0.2
    """What the phone's directions are assumed to be off by."""
    mesh_error_m: float = 0.006
    """What the mesh is assumed to be off by around a tag, however many frames see it."""
    ray_outlier_px: float = 15.0
    """Rays that pass a corner further away than this are dropped from its triangulation."""
    min_parallax_deg: float = 5.0
    """Least angle between two rays of a corner, for its triangulation to count."""
    adjust: bool = True
    """Adjust all tags and phone poses together, where the tag size is known."""
    drift_m_per_s: float = 0.002
    """What the error of the phone's position is assumed to change by over a second."""
    drift_deg_per_s: float = 0.04
    """What the error of the phone's direction is assumed to change by over a second."""

    @property
    def triangulation(self) -> TriangulationOptions:
        """How the rays are joined: the phone's poses are off by several pixels."""
        return TriangulationOptions(
            huber_px=4.0,
            outlier_px=self.ray_outlier_px,
            min_parallax_deg=self.min_parallax_deg,
            max_rms_px=self.ray_outlier_px,
        )

    @property
    def bundle(self) -> TagBundleOptions:
        """What the joint adjustment assumes."""
        return TagBundleOptions(
            pose_error_m=self.pose_error_m,
            pose_error_deg=self.pose_error_deg,
            drift_m_per_s=self.drift_m_per_s,
            drift_deg_per_s=self.drift_deg_per_s,
        )


@dataclass(frozen=True, kw_only=True)
class SfmCornerOptions:
    """How tags are put into the reconstruction."""

    least_sightings: int = 2
    """Registered frames that must show a tag."""
    outlier_px: float = 4.0
    """Sightings whose corners are off by more than this are dropped."""
    min_parallax_deg: float = 1.5
    """Least angle between two rays of a corner."""
    max_rms_px: float = 3.0
    """Tags with a larger remaining error are left out."""

    @property
    def triangulation(self) -> TriangulationOptions:
        """How the rays are joined."""
        return TriangulationOptions(
            outlier_px=self.outlier_px, min_parallax_deg=self.min_parallax_deg, max_rms_px=self.max_rms_px
        )


def map_scan_corners(
    scan: RoomScan,
    raycaster: Raycaster,
    sightings: TagSightings,
    options: ScanCornerOptions | None = None,
    tag_size_m: float | None = None,
    report: Report = silent,
) -> TagCorners:
    """The tags' corners in the frame `scan`, from sightings in `scan.frames_with_images` (`frame_index` counts these).

    `spread` is the RMS distance in metres between the places that single sightings give and the answer; for a tag seen
    once it is the assumed error of mesh and pose. Tags that no sighting puts on the mesh or that are not determined
    by their rays are left out, as are ids seen in two places; `notes` says so.

    Raises:
        InputError: if the tag size is not above 0.
        Cancelled: when `report` raises it.
    """
    options = options or ScanCornerOptions()
    if tag_size_m is not None and not 0 < tag_size_m < 10:
        raise InputError(f"The tag size is {tag_size_m} m; give the side between the detected corners in metres.")
    frames = scan.frames_with_images
    at = sightings.frame_index.tolist()
    if not at:
        return _columns({}, [])
    poses = RigidTransform.concatenate([frames[i].scan_from_camera for i in at])
    cameras = [frames[i].camera for i in at]
    report(0.1, f"Casting rays at {len(at)} tag sightings")
    on_mesh = _places_on_mesh(raycaster, sightings, cameras, poses, options)
    report(0.6, "Triangulating tag corners")
    by_rays = _triangulated(sightings, cameras, poses, options.triangulation)
    sigma = _sighting_sigma_m(cameras, on_mesh, poses, options)
    found: dict[int, _Tag] = {}
    notes: list[str] = []
    for number, tag_id in enumerate(np.unique(sightings.tag_id).tolist()):
        mine = sightings.tag_id == tag_id
        four = slice(4 * number, 4 * number + 4)
        rays = (by_rays.points[four], by_rays.covariance[four]) if by_rays.is_reliable[four].all() else None
        placed = _place(on_mesh[mine], sigma[mine], rays, int(by_rays.views[four].min()), tag_size_m, options)
        if isinstance(placed, str):
            notes.append(f"Tag {tag_id} {placed}.")
        else:
            found[tag_id] = placed
    if tag_size_m is not None and options.adjust and found:
        report(0.8, "Adjusting tags and phone poses together")
        found = _adjusted(found, scan, sightings, on_mesh, sigma, tag_size_m, options)
    report(1.0, " ".join(notes) or f"{len(found)} tags on the scan")
    return _columns(found, notes)


def _adjusted(
    found: dict[int, _Tag],
    scan: RoomScan,
    sightings: TagSightings,
    on_mesh: Floats,
    sigma: Floats,
    tag_size_m: float,
    options: ScanCornerOptions,
) -> dict[int, _Tag]:
    """The tags after `adjust_tags`, from those sightings that agree with where they were thought to be."""
    frames, ids = scan.frames_with_images, list(found)
    start = np.array([found[i].corners for i in ids])
    tag = np.array([ids.index(i) if i in found else -1 for i in sightings.tag_id.tolist()])
    off = np.linalg.norm(on_mesh.mean(axis=1) - start[tag].mean(axis=1), axis=1)
    use = (tag >= 0) & ~(off > options.agree_m)  # NaN, which is no place on the mesh, is used
    focal_and_centre = [(*f.camera.focal_px, *f.camera.principal_point_px) for f in frames]
    answer = adjust_tags(
        TagScene(
            poses=RigidTransform.concatenate([frame.scan_from_camera for frame in frames]),
            seconds=np.array([frame.timestamp_ns for frame in frames]) / 1e9,
            frame=sightings.frame_index[use],
            tag=tag[use],
            pixels=sightings.corners_px[use],
            intrinsics=np.array(focal_and_centre)[sightings.frame_index[use]],
            on_mesh=on_mesh[use],
            corners=start,
        ),
        tag_size_m,
        options.bundle,
    )
    meets = use & np.isfinite(off)
    return {
        tag_id: found[tag_id]._replace(
            corners=corners,
            spread=_spread(on_mesh[meets & (tag == k)], sigma[meets & (tag == k)], corners, options)
            if (meets & (tag == k)).any()
            else found[tag_id].spread,
        )
        for k, (tag_id, corners) in enumerate(zip(ids, answer, strict=True))
    }


def triangulate_sfm_corners(
    model: SfmModel, camera: Camera, sightings: TagSightings, options: SfmCornerOptions | None = None
) -> TagCorners:
    """The tags' corners in the frame `sfm`, from sightings in the recording's undistorted frames that are registered.

    `camera` is the undistorted camera of the sightings. `spread` is the RMS distance of the sightings' rays from the
    corners, in sfm units. Tags seen in too few frames, without parallax, or in two places are left out, with a note.
    """
    options = options or SfmCornerOptions()
    row_of = {int(index): row for row, index in enumerate(model.frame_indices) if index >= 0}
    rows = np.array([row_of.get(int(index), -1) for index in sightings.frame_index], dtype=np.int64)
    seen = sightings.pick(rows >= 0)
    poses = model.sfm_from_camera[rows[rows >= 0]]
    if len(seen) == 0:
        return _columns({}, [])
    answer = _triangulated(seen, [camera] * len(seen), poses, options.triangulation)
    distance = np.linalg.norm(np.repeat(poses.translation, 4, axis=0) - answer.points[_point_of(seen)], axis=1)
    found: dict[int, _Tag] = {}
    notes: list[str] = []
    for number, tag_id in enumerate(np.unique(seen.tag_id).tolist()):
        four = slice(4 * number, 4 * number + 4)
        mine, views = np.repeat(seen.tag_id == tag_id, 4), int(answer.views[four].min())
        share = float(answer.is_used[mine].mean())
        if views < options.least_sightings or not answer.is_reliable[four].all():
            notes.append(f"Tag {tag_id} is not determined by its {int(mine.sum()) // 4} sightings; left out.")
        elif mine.sum() >= 16 and share < 1 - _SPLIT_SHARE:
            notes.append(f"Tag {tag_id} {_IN_TWO_PLACES}.")
        else:
            scale = np.median(distance[mine & answer.is_used]) / float(camera.focal_px.mean())
            spread = float(np.sqrt(np.mean(answer.rms_px[four] ** 2)) * scale)
            found[tag_id] = _Tag(answer.points[four], views, spread, side_of(fit_square(answer.points[four], None)))
    return _columns(found, notes)


class _Tag(NamedTuple):
    corners: Floats
    sightings: int
    spread: float
    free_side: float


def _columns(found: dict[int, _Tag], notes: list[str]) -> TagCorners:
    return TagCorners(
        np.array(list(found), dtype=np.int64),
        np.array([tag.corners for tag in found.values()]).reshape(-1, 4, 3),
        np.array([tag.sightings for tag in found.values()], dtype=np.int64),
        np.array([tag.spread for tag in found.values()], dtype=np.float64),
        tuple(notes),
        np.array([tag.free_side for tag in found.values()], dtype=np.float64),
    )


def _point_of(sightings: TagSightings) -> Ints:
    """The number of each corner's point (4 S,): four per tag, tags by rising id."""
    _, tag = np.unique(sightings.tag_id, return_inverse=True)
    return np.asarray((4 * tag[:, None] + np.arange(4)).ravel(), dtype=np.int64)


def _triangulated(
    sightings: TagSightings, cameras: list[Camera], poses: RigidTransform, options: TriangulationOptions
) -> TriangulatedPoints:
    """The corners of all tags, four points per tag, tags by rising id."""
    per_corner = np.repeat(np.arange(len(sightings)), 4)
    seen = Observations.of(
        _point_of(sightings), [cameras[i] for i in per_corner], poses[per_corner], sightings.corners_px.reshape(-1, 2)
    )
    return triangulate(seen, 4 * len(np.unique(sightings.tag_id)), options)


def _places_on_mesh(
    raycaster: Raycaster,
    sightings: TagSightings,
    cameras: list[Camera],
    poses: RigidTransform,
    options: ScanCornerOptions,
) -> Floats:
    """The corners (S, 4, 3) where each sighting alone puts them on the mesh, NaN where it cannot."""
    inner, corner = [], []
    matrices = poses.rotation.as_matrix().reshape(-1, 3, 3)
    for pixels, camera, rotation in zip(sightings.corners_px, cameras, matrices, strict=True):
        inner.append(camera.unproject(inside_of_tag_px(pixels, options.rays_per_side)) @ rotation.T)
        corner.append(camera.unproject(pixels) @ rotation.T)
    per_sighting = options.rays_per_side**2
    centres = np.array(poses.translation).reshape(-1, 3)
    hits = raycaster.cast(np.repeat(centres, per_sighting, axis=0), np.concatenate(inner))
    points = raycaster.points(hits).reshape(len(sightings), per_sighting, 3)
    places = np.full((len(sightings), 4, 3), np.nan)
    for i, (hit, centre, rays) in enumerate(zip(points, centres, corner, strict=True)):
        place = _corners_on_plane(hit, centre, rays, options)
        if place is not None:
            places[i] = place
    return places


def _corners_on_plane(hits: Floats, centre: Floats, rays: Floats, options: ScanCornerOptions) -> Floats | None:
    """Where rays (4, 3) from `centre` meet the plane of the hits (N, 3); None if that is not a place to trust."""
    good = hits[np.isfinite(hits).all(axis=1)]
    if len(good) < max(3.0, options.least_hits * len(hits)):
        return None
    middle, normal, rms = fit_plane(good)
    facing = rays @ normal
    if rms > options.max_plane_rms_m or np.abs(facing).min() < np.cos(np.radians(options.max_incidence_deg)):
        return None
    return np.asarray(centre + (((middle - centre) @ normal) / facing)[:, None] * rays)


def _sighting_sigma_m(
    cameras: list[Camera], on_mesh: Floats, poses: RigidTransform, options: ScanCornerOptions
) -> Floats:
    """(S,) what each sighting's place is assumed to be off by, from the pose, the distance and the slant."""
    distance = np.linalg.norm(on_mesh.mean(axis=1) - np.array(poses.translation).reshape(-1, 3), axis=1)
    focal = np.array([float(camera.focal_px.mean()) for camera in cameras])
    angle = np.hypot(np.radians(options.pose_error_deg), 1.0 / focal)  # the pose, and a pixel of the detector
    a, b, c, _ = np.moveaxis(on_mesh, 1, 0)
    normal = np.cross(b - a, c - a)
    ray = on_mesh.mean(axis=1) - np.array(poses.translation).reshape(-1, 3)
    facing = np.abs(np.sum(normal * ray, axis=1)) / np.linalg.norm(normal, axis=1) / distance
    return np.asarray(np.hypot(options.pose_error_m, distance * angle) / np.maximum(facing, 0.1))


def _place(
    places: Floats,
    sigma: Floats,
    rays: tuple[Floats, Floats] | None,
    ray_views: int,
    tag_size_m: float | None,
    options: ScanCornerOptions,
) -> _Tag | str:
    """One tag from its sightings' places on the mesh (n, 4, 3), NaN for some, and from its rays; or why not."""
    on_mesh = np.isfinite(places).all(axis=(1, 2))
    places, sigma = places[on_mesh], sigma[on_mesh]
    if len(places) == 0:
        if rays is None:
            return "is seen, but neither meets the mesh nor is determined by its rays; left out"
        spread = float(np.sqrt(np.trace(rays[1], axis1=1, axis2=2).mean()))
        return _Tag(fit_square(rays[0], tag_size_m), ray_views, spread, side_of(fit_square(rays[0], None)))
    agree = _largest_group(places.mean(axis=1), options.agree_m)
    others = places[~agree].mean(axis=1)
    if (~agree).mean() > _SPLIT_SHARE and _largest_group(others, options.agree_m).sum() >= 2:
        return _IN_TWO_PLACES
    mean, variance = _robust_mean(places[agree], sigma[agree], options)
    joined = mean if rays is None else _joined(mean, variance, *rays, options)
    corners = fit_square(joined, tag_size_m)
    spread = _spread(places[agree], sigma[agree], corners, options)
    return _Tag(corners, int(agree.sum()), spread, side_of(fit_square(joined, None)))


def _spread(places: Floats, sigma: Floats, corners: Floats, options: ScanCornerOptions) -> float:
    """RMS distance of places (n, 4, 3) from the corners; of a single one what it is assumed to be off by."""
    if len(places) == 1:
        return float(np.hypot(sigma[0], options.mesh_error_m))
    return float(np.sqrt(np.mean(np.sum((places - corners) ** 2, axis=2))))


def _largest_group(centres: Floats, radius: float) -> Bools:
    """(n,) which centres (n, 3) lie within `radius` of the one that has the most others so near."""
    near = np.linalg.norm(centres[:, None] - centres[None], axis=2) <= radius
    return np.asarray(near[near.sum(axis=1).argmax()])


def _robust_mean(places: Floats, sigma: Floats, options: ScanCornerOptions) -> tuple[Floats, float]:
    """The mean (4, 3) of places (n, 4, 3), by their sigmas and Huber weights, and its variance in m²."""
    weight = 1 / sigma**2
    for _ in range(_HUBER_ROUNDS):
        mean = np.average(places, axis=0, weights=weight)
        distance = np.sqrt(np.mean(np.sum((places - mean) ** 2, axis=2), axis=1))
        bound = 1.5 * np.median(distance) + 1e-9
        weight = np.minimum(1.0, bound / np.maximum(distance, 1e-12)) / sigma**2
    return mean, float(1 / np.sum(1 / sigma**2) + options.mesh_error_m**2)


def _joined(mesh: Floats, variance: float, points: Floats, covariance: Floats, options: ScanCornerOptions) -> Floats:
    """The mean (4, 3) of the corners by mesh and by rays, each by its inverse covariance."""
    floor = (options.pose_error_m / 2) ** 2 * np.eye(3)  # what drifts slowly does not average out
    by_rays = np.linalg.inv(covariance + floor)
    by_mesh = np.broadcast_to(np.eye(3) / variance, (4, 3, 3))
    right = np.einsum("nij,nj->ni", by_rays, points) + mesh / variance
    return np.asarray(np.linalg.solve(by_rays + by_mesh, right[..., None])[..., 0])
