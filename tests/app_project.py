"""A small project as the stages would have left it, ready to be aligned: pictures that really show its room.

Made in seconds and without structure from motion: the reconstruction is the truth, moved into a frame `sfm` of its own.
"""

from __future__ import annotations

import atexit
import json
import shutil
import tempfile
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
import trimesh
from scipy.spatial.transform import RigidTransform, Rotation

from gazeloc_core.camera import Camera
from gazeloc_core.export.tum import write_tum
from gazeloc_core.methods import Method
from gazeloc_core.pipeline import run_after_choice
from gazeloc_core.project import Chosen, Project, RecordingEntry, ScanEntry, Settings, TagEntry
from gazeloc_core.scan import Mesh
from gazeloc_core.sfm_model import SfmModel
from gazeloc_core.stages import anchoring, inputs, recording, scan
from gazeloc_core.stages.registration import align_keypoints
from gazeloc_core.surfaces.raycast import Raycaster
from gazeloc_core.surfaces.render import RayRenderer
from gazeloc_core.tag_types import TagCorners, TagSightings
from gazeloc_core.trajectory import PoseStatus, Trajectory
from gazeloc_core.transforms import Similarity

SIZE_M = np.array([4.0, 3.0, 2.6])
WALLS = {
    "floor": (150, 128, 104),
    "ceiling": (244, 244, 240),
    "left": (188, 96, 84),
    "right": (86, 140, 108),
    "front": (120, 130, 168),
    "back": (222, 190, 96),
}
BOXES = {  # extents, centre and colour of furniture
    "desk": ((1.2, 0.6, 0.74), (1.1, 0.32, 0.37), (176, 122, 66)),
    "shelf": ((0.3, 0.9, 1.5), (0.16, 2.2, 0.75), (92, 66, 120)),
    "stool": ((0.4, 0.4, 0.45), (2.9, 1.9, 0.225), (40, 150, 170)),
}
MARKS = {  # distinct things of 16 cm on walls and furniture: centre, what faces the room, colour. Tags are there too
    0: ((1.0, 0.01, 1.5), (0, 1, 0), (20, 20, 20)),
    1: ((0.01, 0.9, 1.6), (1, 0, 0), (250, 250, 250)),
    2: ((3.0, 0.01, 1.1), (0, 1, 0), (200, 30, 30)),
    3: ((0.9, 0.3, 0.75), (0, 0, 1), (30, 60, 200)),
    4: ((2.9, 1.9, 0.46), (0, 0, 1), (250, 240, 60)),
    5: ((1.7, 2.2, 0.01), (0, 0, 1), (240, 240, 240)),
}
TAG_SIZE_M = 0.16
LENS = Camera.from_opencv(400, 360, [[300, 0, 203.0], [0, 301.0, 178.0], [0, 0, 1]], [-0.12, 0.06, 0.0005, -0.0004])
SFM_FROM_SCAN = Similarity(0.43, Rotation.from_rotvec([0.4, -1.0, 0.3]), np.array([1.0, -2.0, 0.5]))
START_NS, STEP_NS = 1_700_000_000_000_000_000, 250_000_000
FRAMES = 16


def room_mesh() -> Mesh:
    """A furnished room of one storey, z up, colours by vertex, all faces turned into the room."""
    parts = [_walls()]
    for extents, centre, color in BOXES.values():
        parts.append(_box(extents, centre, color))
    for centre, outward, color in MARKS.values():
        thin = [TAG_SIZE_M if axis == 0 else 0.02 for axis in np.abs(outward)]
        parts.append(_box(thin, centre, color))
    vertices = np.concatenate([part.vertices for part in parts])
    offsets = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
    faces = np.concatenate([part.faces + offset for part, offset in zip(parts, offsets, strict=True)])
    return Mesh(vertices, faces, np.concatenate([part.colors for part in parts]))


def true_poses(count: int = FRAMES) -> RigidTransform:
    """`scan_from_camera` of a head that walks along the far side and looks at the corner with the furniture."""
    along = np.linspace(0, 1, count)
    centres = np.column_stack([1.6 + 1.9 * along, 2.6 - 0.5 * np.sin(3 * along), 1.6 + 0.05 * np.cos(9 * along)])
    aims = np.column_stack([0.9 + 1.0 * along, 0.3 * np.ones(count), 0.9 + 0.15 * np.sin(5 * along)])
    forward = (aims - centres) / np.linalg.norm(aims - centres, axis=1, keepdims=True)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    axes = np.stack([right, np.cross(forward, right), forward], axis=2)
    return RigidTransform.from_components(centres, Rotation.from_matrix(axes))


def mark_corners() -> TagCorners:
    """The true corners of the marks on the scan, as of tags."""
    corners = []
    for centre, outward, _ in MARKS.values():
        into = -np.array(outward, dtype=float)
        x = np.cross((0.0, 1.0, 0.0) if abs(into[2]) > 0.5 else (0.0, 0.0, 1.0), into)
        y = np.cross(into, x)
        surface = np.array(centre) + 0.01 * np.array(outward)
        corners.append([surface + (a * x + b * y) * TAG_SIZE_M / 2 for a, b in ((-1, 1), (1, 1), (1, -1), (-1, -1))])
    count = len(MARKS)
    return TagCorners(np.array(list(MARKS)), np.array(corners), np.full(count, 6), np.full(count, 0.002))


def make_app_project(folder: Path, *, recordings: tuple[str, ...] = ("walk",), tags: bool = True) -> Project:
    """`folder/project`, its scan and recordings beside it: everything up to the reconstruction and tags is fresh.

    A copy of one that is made once per process, which takes a second.
    """
    shutil.copytree(_template(recordings, tags), folder, dirs_exist_ok=True)
    return Project.open(folder / "project")


@lru_cache(maxsize=4)
def with_poses(project: Project) -> Project:
    """The project with the alignment of its tags chosen, as by a person, and its poses and gaze made."""
    alignment = align_keypoints(project, "walk")
    project.choose("walk", Chosen(alignment=alignment.key, by_person=True))
    run_after_choice(project, "walk", Method.SFM)
    return project


def _template(recordings: tuple[str, ...], tags: bool) -> Path:
    folder = Path(tempfile.mkdtemp(prefix="gazeloc-app-project-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    mesh = room_mesh()
    trimesh.Trimesh(mesh.vertices, mesh.faces, vertex_colors=mesh.colors, process=False).export(folder / "room.ply")
    entries = {name: _write_recording(folder / name, mesh) for name in recordings}
    settings = Settings(
        scan=ScanEntry(path=folder / "room.ply", unit="m", up_axis="z"),
        tags=TagEntry(family="tag36h11", size_m=TAG_SIZE_M) if tags else None,
        recordings=entries,
    )
    project = Project.create(folder / "project", settings)
    if tags:
        _write_scan_tags(project)
    for name in recordings:
        _write_stages(project, name, mesh, tags)
    return folder


def _write_recording(folder: Path, mesh: Mesh) -> RecordingEntry:
    folder.mkdir()
    renderer = RayRenderer(mesh, raycaster=Raycaster(mesh))
    times = [START_NS + i * STEP_NS for i in range(FRAMES)]
    for i, pose in enumerate(true_poses()):
        rgb = renderer.render(LENS, pose).rgb
        cv2.imwrite(str(folder / f"f_{i:03d}.png"), cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR))
    (folder / "camera.json").write_text(json.dumps(LENS.to_json()))
    rows = [f"f_{i:03d}.png,{time}" for i, time in enumerate(times)]
    (folder / "timestamps.csv").write_text("\n".join(["name,timestamp_ns", *rows]) + "\n")
    samples = range(START_NS, times[-1], 20_000_000)
    rows = [f"s,r,{time},{150 + 5 * (i % 21)},{140 + 3 * (i % 17)},1" for i, time in enumerate(samples)]
    header = "section id,recording id,timestamp [ns],gaze x [px],gaze y [px],worn"
    (folder / "gaze.csv").write_text("\n".join([header, *rows]) + "\n")
    poses = true_poses()
    truth = Trajectory(
        timestamp_ns=np.array(times),
        status=np.array([PoseStatus.REGISTERED.value] * FRAMES),
        is_keyframe=np.ones(FRAMES, bool),
        centers=poses.translation,
        wxyz=poses.rotation.as_quat(scalar_first=True),
    )
    write_tum(truth, folder.with_suffix(".tum"))
    return RecordingEntry(path=folder, truth=folder.with_suffix(".tum"))


def _write_scan_tags(project: Project) -> None:
    project.scan_artifact("tags").write_arrays(
        inputs.sightings_arrays(_no_sightings()), options={}, inputs=scan.tag_inputs(project)
    )
    project.scan_artifact("corners").write_arrays(
        inputs.corners_arrays(mark_corners()), options={}, inputs=scan.corner_inputs(project)
    )


def _write_stages(project: Project, name: str, mesh: Mesh, tags: bool) -> None:
    keyframes = np.arange(0, FRAMES, 2)
    project.artifact(name, "keyframes").write_arrays(
        {"keyframes": keyframes}, options={}, inputs=recording.keyframe_inputs(project, name)
    )
    recording.undistort(project, name)
    camera = inputs.load_undistorted_camera(project, name)
    if tags:
        project.artifact(name, "tags").write_arrays(
            inputs.sightings_arrays(_no_sightings()), options={}, inputs=recording.tag_inputs(project, name)
        )
    models = inputs.model_arrays([_model(mesh, camera, keyframes)])
    project.artifact(name, "reconstruction").write_arrays(
        models, options={}, inputs=recording.reconstruction_inputs(project, name)
    )
    if tags:
        project.artifact(name, "anchoring").write_arrays(
            models, options={}, inputs=anchoring.anchoring_inputs(project, name), notes=("Not bent to the tags.",)
        )
        on_scan = mark_corners()
        in_sfm = TagCorners(on_scan.tag_id, SFM_FROM_SCAN.apply(on_scan.corners), on_scan.sightings, on_scan.spread)
        project.artifact(name, "corners").write_arrays(
            inputs.corners_arrays(in_sfm), options={}, inputs=recording.corner_inputs(project, name)
        )


def _model(mesh: Mesh, camera: Camera, keyframes: np.ndarray, points: int = 3000) -> SfmModel:
    """The true reconstruction: points that lie on the mesh and are seen by a camera, in the frame sfm."""
    rng = np.random.default_rng(4)
    poses = true_poses()[keyframes]
    renderer = Raycaster(mesh)
    found, colors = [], []
    for pose in poses:
        pixels = rng.uniform((0, 0), (camera.width, camera.height), (points // len(keyframes), 2))
        hits = renderer.cast(pose.translation, camera.unproject(pixels) @ pose.rotation.as_matrix().T)
        found.append(renderer.points(hits)[hits.is_hit])
        colors.append(renderer.colors(hits, (0, 0, 0))[hits.is_hit])
    in_scan = np.concatenate(found)
    return SfmModel(
        cameras={1: camera},
        image_names=tuple(recording.image_name(i) for i in keyframes.tolist()),
        image_camera_ids=np.ones(len(keyframes), int),
        sfm_from_camera=SFM_FROM_SCAN.compose_pose(poses),
        frame_indices=keyframes,
        points=SFM_FROM_SCAN.apply(in_scan),
        point_colors=np.concatenate(colors),
        point_errors_px=np.full(len(in_scan), 0.5),
        track_lengths=np.full(len(in_scan), 5),
        observation_point=np.zeros(0, int),
        observation_image=np.zeros(0, int),
        observation_px=np.zeros((0, 2)),
    )


def _no_sightings() -> TagSightings:
    return TagSightings(np.zeros(0, int), np.zeros(0, int), np.zeros((0, 4, 2)), np.zeros(0))


def _walls(step_m: float = 0.2) -> Mesh:
    """The six sides in a grid: x, y, z are 0 or the room's size; normals point into the room."""
    sides = {
        "floor": (2, 0, (0, 1)),
        "ceiling": (2, 1, (1, 0)),
        "left": (0, 0, (1, 2)),
        "right": (0, 1, (2, 1)),
        "front": (1, 0, (2, 0)),
        "back": (1, 1, (0, 2)),
    }
    vertices, faces, colors = [], [], []
    for name, (axis, end, (first, second)) in sides.items():
        m, n = (round(SIZE_M[a] / step_m) for a in (first, second))
        i, j = (index.ravel() for index in np.mgrid[0 : m + 1, 0 : n + 1])
        points = np.zeros((len(i), 3))
        points[:, axis], points[:, first], points[:, second] = end * SIZE_M[axis], i * step_m, j * step_m
        corner = (np.arange(m)[:, None] * (n + 1) + np.arange(n)).ravel()
        quads = np.stack([corner, corner + n + 1, corner + n + 2, corner + 1], axis=1) + sum(map(len, vertices))
        faces += [quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]
        vertices.append(points)
        colors.append(np.broadcast_to(np.array(WALLS[name], np.uint8), (len(i), 3)))
    return Mesh(np.concatenate(vertices), np.concatenate(faces), np.concatenate(colors))


def _box(extents: tuple[float, ...] | list[float], centre: tuple[float, ...], color: tuple[int, ...]) -> Mesh:
    box = trimesh.creation.box(extents)
    vertices, faces = trimesh.remesh.subdivide_to_size(box.vertices, box.faces, 0.25)
    return Mesh(vertices + np.array(centre), faces, np.broadcast_to(np.array(color, np.uint8), (len(vertices), 3)))
