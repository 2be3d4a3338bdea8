"""Structure from motion on undistorted keyframes: pycolmap with known, fixed intrinsics.

The steps: SIFT features on the CPU, and the corners of tags (`tags.py`); more frames where neighbours share little
(`bridges.py`); pairs of frames near in time, and frames that look alike (`pairs.py`); matching with geometric
verification; incremental mapping; a last adjustment (`polish.py`). Keyframes that stay out are then matched with
all others and the mapping is done once more. Mapping works in a thread of its own, so that progress is shown and a
cancel reaches it.
"""

from __future__ import annotations

import shutil
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pycolmap

from gazeloc_core.arrays import Ints
from gazeloc_core.camera import Camera
from gazeloc_core.errors import InputError, ReconstructionError
from gazeloc_core.progress import Report, part, silent
from gazeloc_core.sfm.bridges import MoreFrames, frames_in_gaps
from gazeloc_core.sfm.colmap_io import read_model
from gazeloc_core.sfm.pairs import Pairs, choose_pairs
from gazeloc_core.sfm.polish import polish
from gazeloc_core.sfm.tags import corner_descriptors, corner_keypoints
from gazeloc_core.sfm_model import SfmModel
from gazeloc_core.tag_types import TagSightings

_POLL_S = 0.2
_LEAST_IMAGES = 3
_IMAGES_PER_CALL = 8
_PAIRS_PER_CALL = 150

_T = TypeVar("_T")


@dataclass(frozen=True, kw_only=True)
class SfmOptions:
    """How the keyframes are reconstructed."""

    max_features: int = 3000
    """SIFT features kept per frame."""
    peak_threshold: float = 0.0015
    """Least contrast of a SIFT feature; lower finds more in dim frames (COLMAP's own default is 0.0067)."""
    upsample_below_px: int = 900
    """Frames narrower than this are searched for features at twice their size: finds more, takes four times as long."""
    sequential_neighbours: int = 7
    """Each frame is matched with this many following ones, and with those 8, 16, 32, ... later."""
    similar_neighbours: int = 7
    """Each frame is matched with this many others that look alike, wherever they are in time."""
    weak_link: int = 60
    """Neighbouring keyframes with fewer matches than this get the frames between them as well; 0: never."""
    least_views: int = 3
    """In the last adjustment points that fewer frames show do not move cameras; 2: all do."""
    exhaustive_up_to: int = 32
    """Recordings with no more keyframes than this are matched in all pairs."""
    threads: int = -1
    """Threads of pycolmap; -1 for one per core."""
    seed: int = 1
    """Seed of every random choice."""


def reconstruct(
    image_folder: Path,
    names: Sequence[str],
    camera: Camera,
    frame_indices: Ints,
    work_folder: Path,
    options: SfmOptions | None = None,
    report: Report = silent,
    *,
    sightings: TagSightings | None = None,
    more_frames: MoreFrames | None = None,
) -> list[SfmModel]:
    """Models of the pictures `names` in `image_folder`, all of one `camera`, the one with the most pictures first.

    `frame_indices` (K,) are the recording's frames of the names. `work_folder` receives the database and may be thrown
    away afterwards; what an earlier run left there is overwritten. `sightings` are tags in the same undistorted frames:
    their corners are features too. `more_frames` are taken where neighbouring pictures share little, and are in the
    models like the others.

    Raises:
        InputError: if a picture is missing, or fewer than three are given.
        ReconstructionError: if no model comes out; says what was tried.
        Cancelled: when `report` raises it.
    """
    options = options or SfmOptions()
    _check_pictures(image_folder, names, frame_indices)
    shutil.rmtree(work_folder, ignore_errors=True)
    work_folder.mkdir(parents=True)
    pycolmap.logging.minloglevel = pycolmap.logging.FATAL.value
    frame_of = dict(zip(names, np.asarray(frame_indices).tolist(), strict=True))
    job = _Job(image_folder, frame_of, camera, work_folder, options, sightings)
    job.extract(names, part(report, 0.0, 0.3))
    if more_frames is not None and options.weak_link > 0:
        job.bridge(more_frames, part(report, 0.3, 0.4))
    pairs = choose_pairs(*job.descriptors(), options)
    job.match(pairs, part(report, 0.4, 0.7))
    models = job.map(part(report, 0.7, 0.9))
    missing = {position for position in job.missing(models) if job.names[position] in names}
    more = {p for p in combinations(range(len(job.names)), 2) if set(p) & missing} - pairs
    if more and len(missing) > 0.02 * len(names):
        job.match(more, part(report, 0.9, 0.95))
        again = job.map(part(report, 0.95, 1.0))
        models = max(models, again, key=lambda found: max((len(m) for m in found), default=0))
    if not models:
        raise ReconstructionError(job.failure(len(pairs | more)))
    report(1.0, f"{len(models[0])} of {len(job.names)} frames registered")
    return [_in_order_of_frames(m, np.array([job.frame_of[name] for name in m.image_names])) for m in models]


def _in_order_of_frames(model: SfmModel, frame_indices: Ints) -> SfmModel:
    """The model joined to the recording's frames, its images sorted by them."""
    order = np.argsort(frame_indices)
    return replace(
        model,
        image_names=tuple(model.image_names[i] for i in order),
        image_camera_ids=model.image_camera_ids[order],
        sfm_from_camera=model.sfm_from_camera[order],
        frame_indices=frame_indices[order],
        observation_image=np.argsort(order)[model.observation_image],
    )


def _check_pictures(folder: Path, names: Sequence[str], frame_indices: Ints) -> None:
    if len(names) != len(frame_indices):
        raise InputError(f"{folder}: there are {len(names)} pictures for {len(frame_indices)} frames; undistort again.")
    if len(names) < _LEAST_IMAGES:
        raise InputError(
            f"{folder}: a reconstruction needs at least {_LEAST_IMAGES} pictures, got {len(names)}; "
            "use a longer recording."
        )
    for name in names:
        if not (folder / name).is_file():
            raise InputError.of(folder / name, "the picture is missing", "undistort the recording again")


class _Job:
    """One database in the work folder, and pycolmap's steps on it."""

    def __init__(
        self,
        images: Path,
        frame_of: dict[str, int],
        camera: Camera,
        work: Path,
        options: SfmOptions,
        sightings: TagSightings | None,
    ):
        self.source, self.frame_of, self.camera, self.work, self.options = images, frame_of, camera, work, options
        self.sightings, self.database, self.images = sightings, work / "database.db", work / "pictures"
        self.images.mkdir()
        for name in frame_of:
            (self.images / name).symlink_to((images / name).absolute())

    @property
    def names(self) -> list[str]:
        """The pictures in the order of their frames."""
        return sorted(self.frame_of, key=self.frame_of.__getitem__)

    def extract(self, names: Sequence[str], report: Report) -> None:
        """SIFT features of some pictures into the database, and the corners of tags after them."""
        extraction = pycolmap.FeatureExtractionOptions()
        extraction.use_gpu, extraction.num_threads = False, self.options.threads
        extraction.sift.max_num_features = self.options.max_features
        extraction.sift.peak_threshold = self.options.peak_threshold
        extraction.sift.first_octave = -1 if self.camera.width < self.options.upsample_below_px else 0
        reader = pycolmap.ImageReaderOptions()
        reader.camera_model = self.camera.model
        reader.camera_params = ",".join(repr(value) for value in self.camera.params.tolist())
        if self.database.exists():
            reader.existing_camera_id = 1  # an earlier call made it
        for start, some in _in_parts(names, _IMAGES_PER_CALL):
            report(start / len(names), f"Features of frame {start} of {len(names)}")
            pycolmap.extract_features(
                self.database,
                self.images,
                list(some),
                camera_mode=pycolmap.CameraMode.SINGLE,
                reader_options=reader,
                extraction_options=extraction,
                device=pycolmap.Device.cpu,
            )
            reader.existing_camera_id = 1
        if self.sightings is not None:
            self._add_corners(set(names), self.sightings)

    def _add_corners(self, names: set[str], sightings: TagSightings) -> None:
        database = pycolmap.Database.open(self.database)
        try:
            ids = {image.name: image.image_id for image in database.read_all_images()}
            known = {name: database.read_descriptors(ids[name]) for name in ids}
            database.clear_descriptors()  # one by one they cannot be replaced
            for name, descriptors in known.items():
                data = descriptors.data
                if name in names:
                    mine = sightings.frame_index == self.frame_of[name]
                    places = [database.read_keypoints(ids[name]), corner_keypoints(sightings.corners_px[mine])]
                    database.update_keypoints(ids[name], np.vstack(places))
                    data = np.vstack([data, corner_descriptors(sightings.tag_id[mine])])
                database.write_descriptors(ids[name], pycolmap.FeatureDescriptors(descriptors.type, data))
        finally:
            database.close()

    def bridge(self, more_frames: MoreFrames, report: Report) -> None:
        """Take further frames, with their features, where neighbouring pictures share too little."""
        names = self.names
        neighbours = list(pairwise(range(len(names))))
        self.match(set(neighbours), part(report, 0.0, 0.3))
        keyframes = np.array([self.frame_of[name] for name in names])
        matches = np.array(self._verified([(names[a], names[b]) for a, b in neighbours]))
        chosen = frames_in_gaps(keyframes, matches, more_frames.frame_indices, self.options.weak_link)
        if len(chosen) == 0:
            return
        added = more_frames.write(chosen, self.images)
        self.frame_of |= dict(zip(added, chosen.tolist(), strict=True))
        self.extract(added, part(report, 0.3, 1.0))

    def _verified(self, pairs: Sequence[tuple[str, str]]) -> list[int]:
        """How many matches of each pair of pictures agree on a geometry."""
        database = pycolmap.Database.open(self.database)
        try:
            ids = {image.name: image.image_id for image in database.read_all_images()}
            found = [(ids[a], ids[b]) for a, b in pairs]
            return [
                len(database.read_two_view_geometry(*pair).inlier_matches)
                if database.exists_two_view_geometry(*pair)
                else 0
                for pair in found
            ]
        finally:
            database.close()

    def descriptors(self) -> tuple[list[Any], int]:
        """The SIFT descriptors of each picture in the order of `names`, (n, 128) uint8, and the seed."""
        database = pycolmap.Database.open(self.database)
        try:
            ids = {image.name: image.image_id for image in database.read_all_images()}
            return [database.read_descriptors(ids[name]).data for name in self.names], self.options.seed
        finally:
            database.close()

    def match(self, pairs: Pairs, report: Report) -> None:
        """Verified matches of these pairs of positions in `names` into the database."""
        matching = pycolmap.FeatureMatchingOptions()
        matching.use_gpu, matching.num_threads = False, self.options.threads
        verification = pycolmap.TwoViewGeometryOptions()
        verification.ransac.random_seed = self.options.seed
        names, pairing = self.names, pycolmap.ImportedPairingOptions()
        pairing.match_list_path = self.work / "pairs.txt"
        for start, some in _in_parts(sorted(pairs), _PAIRS_PER_CALL):
            report(start / len(pairs), f"Matching pair {start} of {len(pairs)}")
            pairing.match_list_path.write_text("".join(f"{names[a]} {names[b]}\n" for a, b in some))
            pycolmap.match_image_pairs(
                self.database,
                matching_options=matching,
                pairing_options=pairing,
                verification_options=verification,
                device=pycolmap.Device.cpu,
            )

    def map(self, report: Report) -> list[SfmModel]:
        """The models of incremental mapping, largest first; none where it finds no start."""
        output = self.work / "models"
        shutil.rmtree(output, ignore_errors=True)
        output.mkdir()
        registered = 2

        def count_one() -> None:
            nonlocal registered
            registered = min(registered + 1, len(self.names))  # a frame may be tried for more than one model

        def work(token: Any) -> list[Path]:
            options = self._mapping_options()
            found = pycolmap.incremental_mapping(
                self.database,
                self.images,
                output,
                options,
                next_image_callback=count_one,
                cancellation_token=token,
            )
            if not token.is_cancelled:
                for key, model in found.items():
                    polish(model, self.options.least_views)
                    model.write_binary(str(output / str(key)))
            return [output / str(key) for key in found]

        folders = _watched(
            work, lambda: (registered / len(self.names), f"Placing frame {registered} of {len(self.names)}"), report
        )
        models = [read_model(folder) for folder in sorted(folders)]
        return sorted((m for m in models if len(m) >= _LEAST_IMAGES), key=lambda m: (-len(m), m.image_names))

    def _mapping_options(self) -> Any:
        mapping = pycolmap.IncrementalPipelineOptions()
        mapping.num_threads = mapping.mapper.num_threads = self.options.threads
        mapping.random_seed = mapping.mapper.random_seed = mapping.triangulation.random_seed = self.options.seed
        mapping.min_model_size = _LEAST_IMAGES
        mapping.ba_refine_focal_length = mapping.ba_refine_extra_params = False
        mapping.mapper.abs_pose_refine_focal_length = mapping.mapper.abs_pose_refine_extra_params = False
        mapping.triangulation.ignore_two_view_tracks = False  # few features per frame: every one counts
        mapping.mapper.init_min_num_inliers = 60
        mapping.mapper.abs_pose_min_num_inliers = 20
        return mapping

    def missing(self, models: list[SfmModel]) -> set[int]:
        """Positions in `names` of the pictures that the largest model lacks."""
        names = set(models[0].image_names) if models else set()
        return {position for position, name in enumerate(self.names) if name not in names}

    def failure(self, tried: int) -> str:
        """The sentence for when no model came out."""
        features = int(np.median([len(d) for d in self.descriptors()[0]]))
        database = pycolmap.Database.open(self.database)
        try:
            agree = database.num_verified_image_pairs()
        finally:
            database.close()
        return (
            f"{self.source}: no reconstruction came out of {len(self.names)} frames (median of {features} features per "
            f"frame, {tried} pairs matched, {agree} of them agree); record with more light, slower turns and steps to "
            "the side, and put more texture or tags into the room."
        )


def _in_parts(items: Sequence[_T], size: int) -> Iterator[tuple[int, Sequence[_T]]]:
    """`items` in runs of `size`, each with the position of its first: short calls, so that a cancel comes through.

    The database itself is never asked for progress: a second copy of SQLite in this process (Python's) would break the
    locks of pycolmap's and garble the file (tried).
    """
    for start in range(0, len(items), size):
        yield start, items[start : start + size]


def _watched(work: Callable[[Any], Any], progress: Callable[[], tuple[float, str]], report: Report) -> Any:
    """The answer of `work(cancellation token)`, done in a thread; what `report` raises meanwhile stops it."""
    token = pycolmap.CancellationToken()
    answer: list[Any] = []
    failure: list[BaseException] = []

    def run() -> None:
        try:
            answer.append(work(token))
        except BaseException as error:  # handed over to the caller's thread
            failure.append(error)

    thread = threading.Thread(target=run, name="pycolmap", daemon=True)
    thread.start()
    try:
        while thread.is_alive():
            thread.join(_POLL_S)
            fraction, text = progress()
            report(min(max(fraction, 0.0), 1.0), text)
    except BaseException:
        token.cancel()
        thread.join()
        raise
    if failure:
        raise failure[0]
    return answer[0]
