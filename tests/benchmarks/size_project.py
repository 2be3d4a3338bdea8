"""A project at the size of real ones, made up in half a minute: what the stages would have left of it.

A room of 1.5 million triangles with coloured vertices, a reconstruction of a million points, and a recording of 10,000
frames with three sets of poses: the truth, and those of the methods `tags` and `tags-paper`, off by centimetres.
"""

from __future__ import annotations

import json
import os
from pathlib import Path

import cv2
import numpy as np
import trimesh
from scipy.spatial.transform import RigidTransform, Rotation

from gazeloc_core.arrays import Floats
from gazeloc_core.camera import Camera
from gazeloc_core.export.tum import write_tum
from gazeloc_core.methods import Method
from gazeloc_core.project import Project, RecordingEntry, ScanEntry, Settings
from gazeloc_core.scan import Mesh
from gazeloc_core.sfm_model import SfmModel
from gazeloc_core.stages import inputs, recording
from gazeloc_core.trajectory import PoseStatus, Trajectory

TRIANGLES, POINTS, FRAMES = 1_500_000, 1_000_000, 10_000
SIZE_M = np.array([6.0, 4.0, 2.8])
CAMERA = Camera.pinhole(640, 480, 420.0, 420.0, 320.0, 240.0)
NAME = "walk"
IN_MODEL = 200
"""Images of the reconstruction: their number does not show on the screen, that of its points does."""


def big_room(triangles: int = TRIANGLES) -> Mesh:
    """A box-shaped room seen from inside, its walls uneven by 2 mm, coloured by place."""
    n = int(np.sqrt(triangles / 12)) + 1
    u, v = (axis.ravel() for axis in np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1)))
    low, high = np.zeros_like(u), np.ones_like(u)
    sides = [(u, v, low), (v, u, high), (low, u, v), (high, v, u), (v, low, u), (u, high, v)]
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    grid = np.concatenate(
        [np.stack([corner, corner + 1, corner + n + 2], 1), np.stack([corner, corner + n + 2, corner + n + 1], 1)]
    )
    share = np.concatenate([np.column_stack(side) for side in sides])
    faces = np.concatenate([grid + side * len(u) for side in range(6)]).astype(np.int32)
    vertices = share * SIZE_M + np.random.default_rng(0).normal(0, 0.002, share.shape)
    waves = 0.5 + 0.5 * np.sin(share * (40, 56, 31) + (0, 2, 4))
    return Mesh(vertices, faces, np.rint(60 + 180 * waves).astype(np.uint8))


def walk_through() -> tuple[Floats, Floats]:
    """Centres (N, 3) and `wxyz` (N, 4) of a head that walks through the room and looks around."""
    along = np.linspace(0, 1, FRAMES)
    centers = np.column_stack(
        [3 + 2.3 * np.sin(14 * along), 2 + 1.4 * np.sin(23 * along + 1), 1.6 + 0.06 * np.sin(300 * along)]
    )
    turns = Rotation.from_euler("ZY", np.column_stack([40 * along, 0.2 * np.sin(90 * along)]))
    looks = turns * Rotation.from_matrix([[0, 0, 1], [-1, 0, 0], [0, -1, 0]])
    return centers, looks.as_quat(scalar_first=True)


def make_size_project(folder: Path) -> Project:
    """`folder/project` and what it is about, beside it."""
    mesh = big_room()
    trimesh.Trimesh(mesh.vertices, mesh.faces, vertex_colors=mesh.colors, process=False).export(folder / "room.ply")
    entry = _write_recording(folder / NAME)
    scan = ScanEntry(path=folder / "room.ply", unit="m", up_axis="z")
    project = Project.create(folder / "project", Settings(scan=scan, recordings={NAME: entry}))
    times = inputs.load_recording(project, NAME).timestamp_ns
    project.artifact(NAME, "keyframes").write_arrays(
        {"keyframes": np.arange(FRAMES)}, options={}, inputs=recording.keyframe_inputs(project, NAME)
    )
    project.artifact(NAME, "undistorted").write(
        lambda part: _write_camera(part / "camera.json"), options={}, inputs=recording.undistort_inputs(project, NAME)
    )
    project.artifact(NAME, "reconstruction").write_arrays(
        inputs.model_arrays([_model(mesh)]), options={}, inputs=recording.reconstruction_inputs(project, NAME)
    )
    rng = np.random.default_rng(1)
    for method, off_m in ((Method.TAGS, 0.02), (Method.TAGS_PAPER, 0.08)):
        trajectory = _trajectory(times, off_m * rng.normal(size=(FRAMES, 3)))
        project.result(NAME, method, "trajectory").write_arrays(
            inputs.trajectory_arrays(trajectory), options={}, inputs={}
        )
    project.choose_method(NAME, Method.TAGS)
    return project


def _write_recording(folder: Path) -> RecordingEntry:
    """10,000 frames that are one picture on the disk."""
    folder.mkdir()
    first = folder / "f_00000.jpg"
    cv2.imwrite(str(first), np.full((CAMERA.height, CAMERA.width, 3), 128, np.uint8))
    names = [f"f_{frame:05d}.jpg" for frame in range(FRAMES)]
    for name in names[1:]:
        os.link(first, folder / name)
    times = np.arange(FRAMES, dtype=np.int64) * 33_333_333 + 1_700_000_000_000_000_000
    _write_camera(folder / "camera.json")
    rows = [f"{name},{time}" for name, time in zip(names, times.tolist(), strict=True)]
    (folder / "timestamps.csv").write_text("\n".join(["name,timestamp_ns", *rows]) + "\n")
    truth = folder.with_suffix(".tum")
    write_tum(_trajectory(times, np.zeros((FRAMES, 3))), truth)
    return RecordingEntry(path=folder, truth=truth)


def _write_camera(path: Path) -> None:
    path.write_text(json.dumps(CAMERA.to_json()))


def _trajectory(times: np.ndarray, off_m: Floats) -> Trajectory:
    centers, wxyz = walk_through()
    status = np.full(FRAMES, PoseStatus.REGISTERED.value)
    return Trajectory(times, status, np.ones(FRAMES, bool), centers + off_m, wxyz)


def _model(mesh: Mesh) -> SfmModel:
    """A million points on the surface, three in four of them in one half of the room."""
    rng = np.random.default_rng(2)
    crowded = np.flatnonzero(mesh.vertices[mesh.faces[:, 0], 0] < SIZE_M[0] / 2)
    faces = np.concatenate([rng.choice(crowded, POINTS // 2), rng.integers(0, len(mesh.faces), POINTS - POINTS // 2)])
    assert mesh.colors is not None
    centers, wxyz = walk_through()
    poses = RigidTransform.from_components(centers, Rotation.from_quat(wxyz, scalar_first=True))[:IN_MODEL].inv()
    return SfmModel(
        cameras={1: CAMERA},
        image_names=tuple(recording.image_name(frame) for frame in range(IN_MODEL)),
        image_camera_ids=np.ones(IN_MODEL, int),
        sfm_from_camera=poses.inv(),
        frame_indices=np.arange(IN_MODEL),
        points=mesh.vertices[mesh.faces[faces]].mean(axis=1),
        point_colors=mesh.colors[mesh.faces[faces, 0]],
        point_errors_px=np.full(POINTS, 0.5),
        track_lengths=np.full(POINTS, 5),
        observation_point=np.zeros(0, int),
        observation_image=np.zeros(0, int),
        observation_px=np.zeros((0, 2)),
    )
