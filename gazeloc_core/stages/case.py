"""A reconstruction whose true poses are known: what experiments and benchmarks align, and how people would click."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial.transform import RigidTransform

from gazeloc_core.alignment.correspondences import Correspondences
from gazeloc_core.alignment.icp import IcpOptions, Target, choose_points
from gazeloc_core.alignment.similarity_fit import fit_similarity
from gazeloc_core.arrays import Floats, Ints
from gazeloc_core.errors import GeometryError, InputError
from gazeloc_core.evaluation.evaluate import match_times, pose_errors
from gazeloc_core.evaluation.truth import read_tum
from gazeloc_core.project import Project
from gazeloc_core.sfm_model import SfmModel
from gazeloc_core.stages import inputs
from gazeloc_core.surfaces.raycast import Raycaster
from gazeloc_core.transforms import Similarity


@dataclass(frozen=True, eq=False)
class Case:
    """A reconstruction, the scan to align it with, and the truth: `images` (K,) of the model and their K true poses."""

    name: str
    model: SfmModel
    raycaster: Raycaster
    images: Ints
    scan_from_camera: RigidTransform

    @classmethod
    def of_project(cls, project: Project, recording: str) -> Case:
        """A recording of a project whose reconstruction is there.

        Raises:
            InputError: if the recording has no truth.
            GeometryError: if fewer than three registered images have a true pose.
        """
        path = project.recording(recording).truth
        if path is None:
            raise InputError(f"{recording}: this is compared with a ground truth; give the recording one with --truth.")
        model = inputs.load_model(project, recording)
        times, poses = read_tum(path)
        rows = match_times(inputs.load_recording(project, recording).timestamp_ns[model.frame_indices], times)
        images = np.flatnonzero(rows >= 0)
        if len(images) < 3:
            raise GeometryError(
                f"{recording}: only {len(images)} registered images have a true pose; three are needed."
            )
        return cls(recording, model, inputs.load_raycaster(project), images, poses[rows[images]])

    @cached_property
    def best(self) -> Similarity:
        """The similarity that fits the camera centres to the true ones: what an exact start is."""
        here = np.array(self.model.sfm_from_camera[self.images].translation)
        return fit_similarity(here, np.array(self.scan_from_camera.translation))

    def errors(self, scan_from_sfm: Similarity) -> tuple[float, float]:
        """Mean position error in metres and rotation error in degrees."""
        poses = scan_from_sfm.compose_pose(self.model.sfm_from_camera[self.images])
        rotation_deg, position_m = pose_errors(poses, self.scan_from_camera)
        return float(position_m.mean()), float(rotation_deg.mean())

    def clicked(self, count: int, sigma_m: float, seed: int) -> Correspondences:
        """Pairs far apart, as a careful person chooses them: at well measured points, noisy on both sides."""
        rng = np.random.default_rng(seed)
        points = choose_points(self.model, self.best, self._target, IcpOptions(voxel_m=0.2, schedule_m=(0.1,)))
        # A careful person clicks several of the far places, not exactly the farthest: from a random third of them.
        chosen = _far_apart(points[rng.permutation(len(points))[: max(len(points) // 3, count)]], count)
        names = tuple(f"point {i}" for i in range(count))
        scan = self.best.apply(chosen) + rng.normal(0, sigma_m, (count, 3))
        sfm = chosen + rng.normal(0, sigma_m, (count, 3)) / self.best.scale
        return Correspondences(names, names, sfm, scan, np.full(count, max(sigma_m, 0.005) * np.sqrt(2)))

    @cached_property
    def _target(self) -> Target:
        return Target(self.raycaster)


def _far_apart(points: Floats, count: int) -> Floats:
    chosen = [0]
    while len(chosen) < count:
        distance = np.linalg.norm(points[:, None] - points[chosen], axis=2).min(axis=1)
        chosen.append(int(distance.argmax()))
    return points[chosen]
