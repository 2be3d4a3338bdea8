"""Tag centres by the paper's recipes (section VI-C), the faithful baseline beside `tags/corners.py`.

On the scan: the ray of a detected centre, from each posed phone frame onto the mesh; the mean of the hits. In the
reconstruction: its points whose observations lie inside of the tag's outline; those with a large reprojection error
are dropped, the rest is clustered by nearest neighbours, and the mean of the largest cluster is the centre.

The paper gives neither its threshold nor what "K-nearest clustering" joins. Here a point is joined to those of its K
nearest neighbours that lie within a radius, and a cluster is what is connected.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from gazeloc_core.alignment.correspondences import Correspondences
from gazeloc_core.arrays import Bools, Floats, Ints, frozen
from gazeloc_core.camera import Camera
from gazeloc_core.errors import GeometryError, InputError
from gazeloc_core.scan import RoomScan
from gazeloc_core.sfm_model import SfmModel
from gazeloc_core.surfaces.raycast import Raycaster
from gazeloc_core.tag_types import TagSightings
from gazeloc_core.tags.square import tag_centre_px


@dataclass(frozen=True, kw_only=True)
class SfmTagCenterOptions:
    """Which points of the reconstruction make a tag's centre."""

    max_error_px: float = 2.0
    """Points with a larger reprojection error are dropped, in pixels (step 1)."""
    neighbours: int = 8
    """A point is joined to at most this many of its nearest neighbours (step 2)."""
    radius_of_scene: float = 0.01
    """Points further apart than this are not joined, as a share of the reconstruction's size (`scene_size`)."""
    least_points: int = 3
    """Tags whose largest cluster has fewer points are left out."""

    def __post_init__(self) -> None:
        if not (self.max_error_px > 0 and self.radius_of_scene > 0 and self.neighbours > 0 and self.least_points > 0):
            raise InputError(f"The options of the paper's tag centres must all be above 0, got {self}.")


@dataclass(frozen=True, eq=False)
class TagCenters:
    """T tags in one frame (`scan` in metres, or `sfm`): `tag_id` (T,) rising, `centers` (T, 3).

    `support` (T,) is how many hits or points the mean is of, `spread` (T,) their RMS distance from it, in the frame's
    units. `notes` are sentences for the user about tags that were left out.
    """

    tag_id: Ints
    centers: Floats
    support: Ints
    spread: Floats
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "tag_id", frozen(self.tag_id, np.int64))
        object.__setattr__(self, "centers", frozen(np.reshape(self.centers, (-1, 3))))
        object.__setattr__(self, "support", frozen(self.support, np.int64))
        object.__setattr__(self, "spread", frozen(self.spread))

    def __len__(self) -> int:
        return len(self.tag_id)

    @classmethod
    def of(cls, clusters: dict[int, Floats], notes: list[str]) -> TagCenters:
        """The means of each tag's points (n, 3)."""
        ids = sorted(clusters)
        means = [clusters[tag].mean(axis=0) for tag in ids]
        spread = [np.sqrt(np.mean(np.sum((clusters[t] - m) ** 2, axis=1))) for t, m in zip(ids, means, strict=True)]
        return cls(
            np.array(ids), np.array(means), np.array([len(clusters[t]) for t in ids]), np.array(spread), (*notes,)
        )


@dataclass(frozen=True, eq=False)
class SfmTagCenters:
    """Tag centres in the reconstruction, and the N points under tags that they come from (figure 9).

    `point_tag` (N,) the tag that a point is under, `point` (N,) its row in the model, `is_kept` (N,) whether it is in
    the tag's largest cluster: all rows are the unfiltered points (9c), the kept ones the filtered (9d).
    """

    centers: TagCenters
    point_tag: Ints
    point: Ints
    is_kept: Bools

    def __post_init__(self) -> None:
        object.__setattr__(self, "point_tag", frozen(self.point_tag, np.int64))
        object.__setattr__(self, "point", frozen(self.point, np.int64))
        object.__setattr__(self, "is_kept", frozen(self.is_kept, np.bool_))


def scan_tag_centers(scan: RoomScan, raycaster: Raycaster, sightings: TagSightings) -> TagCenters:
    """Tag centres in the frame `scan`: the mean of the hits of each tag's centre rays, nothing left out (VI-C).

    `sightings` are in `scan.frames_with_images` (`frame_index` counts these). Tags whose rays all miss get a note.

    Raises:
        InputError: if a sighting is of a frame that the scan does not have.
    """
    frames = scan.frames_with_images
    index = sightings.frame_index
    if len(index) and (index.min() < 0 or index.max() >= len(frames)):
        raise InputError(
            f"{scan.path}: a tag is seen in frame {int(index.max())}, but the scan has {len(frames)} frames with a "
            "picture; detect the tags again."
        )
    rays = np.zeros((len(sightings), 3))
    origins = np.zeros((len(sightings), 3))
    for row, (at, corners) in enumerate(zip(index.tolist(), sightings.corners_px, strict=True)):
        pose = frames[at].scan_from_camera
        rays[row] = pose.rotation.as_matrix() @ _centre_ray(frames[at].camera, corners)
        origins[row] = pose.translation
    hits = raycaster.points(raycaster.cast(origins, rays))
    met = np.isfinite(hits).all(axis=1)
    ids = np.unique(sightings.tag_id).tolist()
    found = {tag: hits[met & (sightings.tag_id == tag)] for tag in ids}
    notes = [f"Tag {tag}: no ray of its centre meets the scan; left out." for tag in ids if not len(found[tag])]
    return TagCenters.of({tag: points for tag, points in found.items() if len(points)}, notes)


def sfm_tag_centers(
    model: SfmModel, camera: Camera, sightings: TagSightings, options: SfmTagCenterOptions | None = None
) -> SfmTagCenters:
    """Tag centres in the frame `sfm`: the mean of the largest cluster of the points under each tag (VI-C, 1 to 3).

    `camera` is the undistorted camera of the sightings, whose `frame_index` counts the recording's frames. Tags with
    too few points get a note.
    """
    options = options or SfmTagCenterOptions()
    under = _points_under_tags(model, camera, sightings)
    radius = options.radius_of_scene * scene_size(model.points)
    clusters: dict[int, Floats] = {}
    kept: list[Bools] = []
    notes: list[str] = []
    for tag, rows in under.items():
        is_kept = model.point_errors_px[rows] <= options.max_error_px
        good = np.flatnonzero(is_kept)
        largest = _largest_cluster(model.points[rows[good]], radius, options.neighbours)
        is_kept[good] = largest
        if is_kept.sum() < options.least_points:
            notes.append(
                f"Tag {tag}: {len(rows)} points of the reconstruction are under it, {int(is_kept.sum())} of them in "
                f"one cluster, which is fewer than {options.least_points}; left out."
            )
            is_kept[:] = False
        else:
            clusters[tag] = model.points[rows[is_kept]]
        kept.append(is_kept)
    return SfmTagCenters(
        TagCenters.of(clusters, notes),
        np.repeat(list(under), [len(rows) for rows in under.values()]),
        np.concatenate([np.zeros(0, np.int64), *under.values()]),
        np.concatenate([np.zeros(0, np.bool_), *kept]),
    )


def scene_size(points: Floats) -> float:
    """The size of a reconstruction (P, 3): the diagonal of the box that holds its middle 90 % along each axis."""
    if len(points) == 0:
        return 0.0
    low, high = np.percentile(points, [5, 95], axis=0)
    return float(np.linalg.norm(high - low))


def center_pairs(scan: TagCenters, sfm: TagCenters, *, sigma_m: float = 0.02) -> Correspondences:
    """The pairs of the K tags that have a centre on both sides, each a group of its own, by rising id.

    Raises:
        GeometryError: for fewer than three of them.
    """
    common, on_scan, in_sfm = np.intersect1d(scan.tag_id, sfm.tag_id, return_indices=True)
    if len(common) < 3:
        raise GeometryError(
            f"The paper's alignment needs the centres of three tags on both sides, but there are {len(common)}: the "
            f"scan has {_list(scan)}, the reconstruction {_list(sfm)}; use method sfm, or record and scan more tags."
        )
    names = tuple(f"tag {tag}" for tag in common.tolist())
    sigma = np.full(len(common), sigma_m)
    return Correspondences(names, names, sfm.centers[in_sfm], scan.centers[on_scan], sigma)


def _list(tags: TagCenters) -> str:
    return f"tags {', '.join(map(str, tags.tag_id.tolist()))}" if len(tags) else "none"


def _centre_ray(camera: Camera, corners_px: Floats) -> Floats:
    """The ray (3,) in the camera through a seen tag's centre: its diagonals are straight only without the lens."""
    rays = camera.unproject(corners_px)
    return np.append(tag_centre_px(rays[:, :2] / rays[:, 2:]), 1.0)


def _points_under_tags(model: SfmModel, camera: Camera, sightings: TagSightings) -> dict[int, Ints]:
    """For each tag the rows of the points (n,) that were observed inside of its outline in any registered frame."""
    image_of = {int(frame): image for image, frame in enumerate(model.frame_indices) if frame >= 0}
    by_image = np.argsort(model.observation_image, kind="stable")
    starts = np.searchsorted(model.observation_image[by_image], np.arange(len(model) + 1))
    found: dict[int, list[Ints]] = {tag: [] for tag in np.unique(sightings.tag_id).tolist()}
    for frame, tag, corners in zip(
        sightings.frame_index.tolist(), sightings.tag_id.tolist(), sightings.corners_px, strict=True
    ):
        if (image := image_of.get(frame)) is not None:
            here = by_image[starts[image] : starts[image + 1]]
            pixels = _as_seen_by(camera, model.camera_of(image), model.observation_px[here])
            found[tag].append(model.observation_point[here[_is_inside(pixels, corners)]])
    return {tag: np.unique(np.concatenate([np.zeros(0, np.int64), *rows])) for tag, rows in found.items()}


def _as_seen_by(camera: Camera, model_camera: Camera, pixels: Floats) -> Floats:
    """Pixels (n, 2) of the model's images as pixels of `camera`; an imported model may have another camera."""
    return camera.project(model_camera.unproject(pixels))


def _is_inside(pixels: Floats, corners_px: Floats) -> Bools:
    """(n,) whether pixels (n, 2) lie inside of a convex outline (4, 2), whichever way it winds."""
    edges = np.roll(corners_px, -1, axis=0) - corners_px
    offsets = pixels[:, None] - corners_px
    sides = edges[:, 0] * offsets[..., 1] - edges[:, 1] * offsets[..., 0]
    return np.asarray((sides > 0).all(axis=1) | (sides < 0).all(axis=1), dtype=np.bool_)


def _largest_cluster(points: Floats, radius: float, neighbours: int) -> Bools:
    """(n,) which points (n, 3) are in the largest set that is connected through near neighbours."""
    if len(points) == 0:
        return np.zeros(0, dtype=np.bool_)
    count = len(points)
    ranks = np.arange(1, min(neighbours + 1, count) + 1)  # the first is the point itself
    distance, nearest = cKDTree(points).query(points, k=ranks, distance_upper_bound=radius)
    row, column = np.nonzero(np.isfinite(distance))
    joined = coo_array((np.ones(len(row)), (row, np.asarray(nearest)[row, column])), shape=(count, count))
    _, label = connected_components(joined, directed=False)
    return np.asarray(label == np.bincount(label).argmax(), dtype=np.bool_)
