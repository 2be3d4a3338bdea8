"""What stages read: the scan, the recording and earlier artifacts, as value types; and the hashes that tell them apart.

Opening a scan or a recording costs a second or more, so the last ones stay in memory, by content hash.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from gazeloc_core.camera import Camera
from gazeloc_core.errors import ProjectError
from gazeloc_core.gaze import GazeInScan
from gazeloc_core.project import Project
from gazeloc_core.readers import open_recording, open_scan
from gazeloc_core.recording import Recording
from gazeloc_core.scan import Mesh, RoomScan, Texture
from gazeloc_core.sfm_model import SfmModel
from gazeloc_core.storage.artifacts import Artifact
from gazeloc_core.storage.files import read_json
from gazeloc_core.storage.hashing import hash_of_value
from gazeloc_core.surfaces.raycast import Raycaster
from gazeloc_core.tag_types import TagCorners, TagSightings
from gazeloc_core.trajectory import Trajectory
from gazeloc_core.transforms import rigid_from_wxyz, wxyz_of

T = TypeVar("T")
_TRAJECTORY_COLUMNS = ("timestamp_ns", "status", "is_keyframe", "centers", "wxyz")
_GAZE_COLUMNS = ("timestamp_ns", "origin", "direction", "hit", "distance_m", "face", "status")
_MODEL_COLUMNS = (
    "image_camera_ids",
    "frame_indices",
    "points",
    "point_colors",
    "point_errors_px",
    "track_lengths",
    "observation_point",
    "observation_image",
    "observation_px",
)


def _keep_last(load: Callable[..., T]) -> Callable[..., T]:
    return lru_cache(maxsize=2)(load)


def scan_hash(project: Project) -> str:
    """The hash of the scan's files and of what the project says about them."""
    entry = project.settings.scan
    return hash_of_value([project.hash_of_file(entry.path), entry.unit, entry.up_axis])


def recording_hash(project: Project, recording: str) -> str:
    """The hash of the recording's files."""
    return project.hash_of_file(project.recording(recording).path)


def load_scan(project: Project) -> RoomScan:
    """The scan as its file has it."""
    entry = project.settings.scan
    return _open_scan(entry.path, entry.unit, entry.up_axis, scan_hash(project))


def load_recording(project: Project, recording: str) -> Recording:
    """The recording as its files have it."""
    return _open_recording(project.recording(recording).path, recording_hash(project, recording))


def load_mesh(project: Project) -> Mesh:
    """The scan's mesh; where the file has no colours, with those that the stage `colors` took from the frames."""
    scan = load_scan(project)
    artifact = project.scan_artifact("colors")
    if scan.mesh.has_colors or not artifact.exists:
        return scan.mesh
    return _mesh_from_arrays(artifact.read_arrays())


def load_raycaster(project: Project) -> Raycaster:
    """Rays against the scan's own mesh (not the one subdivided for colours)."""
    entry = project.settings.scan
    return _raycaster(entry.path, entry.unit, entry.up_axis, scan_hash(project))


def load_sightings(arrays: dict[str, Any]) -> TagSightings:
    """The sightings of an artifact."""
    return TagSightings(arrays["frame_index"], arrays["tag_id"], arrays["corners_px"], arrays["decision_margin"])


def load_corners(arrays: dict[str, Any]) -> TagCorners:
    """The corners of an artifact."""
    columns = (arrays["tag_id"], arrays["corners"], arrays["sightings"], arrays["spread"])
    return TagCorners(*columns, free_side=arrays.get("free_side"))


def sightings_arrays(sightings: TagSightings) -> dict[str, Any]:
    """The columns of tag sightings, for an artifact."""
    return {
        "frame_index": sightings.frame_index,
        "tag_id": sightings.tag_id,
        "corners_px": sightings.corners_px,
        "decision_margin": sightings.decision_margin,
    }


def corners_arrays(corners: TagCorners) -> dict[str, Any]:
    """The columns of tag corners, for an artifact."""
    return {
        "tag_id": corners.tag_id,
        "corners": corners.corners,
        "sightings": corners.sightings,
        "spread": corners.spread,
        "free_side": corners.free_side,
    }


def trajectory_arrays(trajectory: Trajectory) -> dict[str, Any]:
    """The columns of a trajectory, for an artifact."""
    return {name: getattr(trajectory, name) for name in _TRAJECTORY_COLUMNS}


def load_trajectory(arrays: dict[str, Any]) -> Trajectory:
    """The trajectory of an artifact."""
    return Trajectory(**{name: arrays[name] for name in _TRAJECTORY_COLUMNS})


def gaze_arrays(gaze: GazeInScan) -> dict[str, Any]:
    """The columns of gaze in the scan, for an artifact."""
    columns = {name: getattr(gaze, name) for name in _GAZE_COLUMNS}
    return columns | ({} if gaze.fixation_id is None else {"fixation_id": gaze.fixation_id})


def load_gaze(arrays: dict[str, Any]) -> GazeInScan:
    """The gaze in the scan of an artifact."""
    return GazeInScan(**{name: arrays[name] for name in _GAZE_COLUMNS}, fixation_id=arrays.get("fixation_id"))


def sfm_models(project: Project, recording: str) -> Artifact:
    """Where the models are that the method `sfm` places: bent to the tags if that stage has run, else as they came."""
    bent = project.artifact(recording, "anchoring")
    if bent.exists and project.settings.tags is not None:
        return bent
    return project.artifact(recording, "reconstruction")


def load_sfm_model(project: Project, recording: str, rank: int = 0) -> SfmModel:
    """The largest model that the method `sfm` places (`rank` 0) or a smaller one, joined to the recording's frames.

    Raises:
        ProjectError: if there is none, or none of that rank any more.
    """
    models = load_sfm_models(project, recording)
    if rank >= len(models):
        raise ProjectError(
            f"{recording}: the reconstruction has no piece {rank + 1} any more, it was made anew; run `gazeloc run`."
        )
    return models[rank]


def load_sfm_models(project: Project, recording: str) -> list[SfmModel]:
    """All models that the method `sfm` places, the largest first."""
    artifact = sfm_models(project, recording)
    return list(_models(artifact, artifact.header().content))


def load_model(project: Project, recording: str) -> SfmModel:
    """The reconstruction's largest model as it came, joined to the recording's frames."""
    return load_models(project, recording)[0]


def load_models(project: Project, recording: str) -> list[SfmModel]:
    """All models of the reconstruction as they came, the largest first."""
    artifact = project.artifact(recording, "reconstruction")
    return list(_models(artifact, artifact.header().content))


def model_arrays(models: list[SfmModel]) -> dict[str, Any]:
    """The columns of all models, for an artifact; model 0 is the largest."""
    arrays: dict[str, Any] = {}
    for rank, model in enumerate(models):
        columns = {name: getattr(model, name) for name in _MODEL_COLUMNS} | {
            "cameras": np.array(json.dumps({key: camera.to_json() for key, camera in model.cameras.items()})),
            "image_names": np.array(model.image_names),
            "wxyz": wxyz_of(model.sfm_from_camera.rotation),
            "centers": model.sfm_from_camera.translation,
        }
        arrays |= {f"{rank}_{name}": column for name, column in columns.items()}
    return arrays


def load_undistorted_camera(project: Project, recording: str) -> Camera:
    """The pinhole camera of a recording's undistorted frames."""
    folder = project.artifact(recording, "undistorted").folder
    return Camera.from_json(read_json(folder / "camera.json", "the undistorted camera"))


def mesh_arrays(mesh: Mesh) -> dict[str, Any]:
    """The columns of a mesh, for an artifact."""
    arrays: dict[str, Any] = {"vertices": mesh.vertices, "faces": mesh.faces}
    if mesh.colors is not None:
        arrays["colors"] = mesh.colors
    if mesh.texture is not None:
        arrays |= {"uv_of_corner": mesh.texture.uv_of_corner, "image_of_face": mesh.texture.image_of_face}
        arrays |= {f"image_{i}": image for i, image in enumerate(mesh.texture.images)}
    return arrays


def _mesh_from_arrays(arrays: dict[str, Any]) -> Mesh:
    texture = None
    if "uv_of_corner" in arrays:
        count = sum(name.startswith("image_") and name[6:].isdigit() for name in arrays)
        images = tuple(np.asarray(arrays[f"image_{i}"]) for i in range(count))
        texture = Texture(images, arrays["uv_of_corner"], arrays["image_of_face"])
    return Mesh(arrays["vertices"], arrays["faces"], arrays.get("colors"), texture)


@_keep_last
def _open_scan(path: Path, unit: str | None, up_axis: str | None, content: str) -> RoomScan:
    del content  # only part of the key: another content is another scan
    return open_scan(path, unit=unit, up_axis=up_axis, colored=False)


@_keep_last
def _open_recording(path: Path, content: str) -> Recording:
    del content
    return open_recording(path)


@_keep_last
def _models(artifact: Artifact, content: str) -> tuple[SfmModel, ...]:
    del content
    arrays = artifact.read_arrays()
    count = sum(name.endswith("_image_names") for name in arrays)
    return tuple(_model_from_arrays(arrays, rank) for rank in range(count))


def _model_from_arrays(arrays: dict[str, Any], rank: int) -> SfmModel:
    prefix = f"{rank}_"
    columns = {name[len(prefix) :]: column for name, column in arrays.items() if name.startswith(prefix)}
    cameras = json.loads(str(columns.pop("cameras")))
    poses = rigid_from_wxyz(columns.pop("wxyz"), columns.pop("centers"), "a pose of the reconstruction")
    return SfmModel(
        cameras={int(key): Camera.from_json(camera) for key, camera in cameras.items()},
        image_names=tuple(columns.pop("image_names").tolist()),
        sfm_from_camera=poses,
        **columns,
    )


@_keep_last
def _raycaster(path: Path, unit: str | None, up_axis: str | None, content: str) -> Raycaster:
    return Raycaster(_open_scan(path, unit, up_axis, content).mesh)
