"""A project whose reconstruction is made up from a known room, so that everything after it runs in milliseconds."""

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np
from box_room import Room, make_room
from tiny_captures import frame_times_ns, write_recording

from gazeloc_core.export.tum import write_tum
from gazeloc_core.keypoints import KeypointPair, KeypointSet
from gazeloc_core.pipeline import run_stage, stage_named
from gazeloc_core.project import Project, RecordingEntry, ScanEntry, Settings
from gazeloc_core.stages import inputs, recording
from gazeloc_core.trajectory import PoseStatus, Trajectory

CLICKED = np.array([[2.5, 0.4, -0.8], [-2.5, 0.2, 0.5], [0.6, 0.1, -2.0], [-1.2, 0.5, 2.0], [1.0, -1.3, 0.7]])


def write_room(path: Path, room: Room) -> Path:
    """The room's mesh as an OBJ, in metres with y up."""
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in room.mesh.vertices]
    path.write_text("\n".join([*lines, *(f"f {a + 1} {b + 1} {c + 1}" for a, b, c in room.mesh.faces)]) + "\n")
    return path


def write_truth(path: Path, room: Room) -> Path:
    """The true pose of every frame of the recording."""
    times = frame_times_ns()
    poses = room.scan_from_camera
    truth = Trajectory(
        timestamp_ns=np.array(times),
        status=np.array([PoseStatus.REGISTERED.value] * len(times)),
        is_keyframe=np.ones(len(times), bool),
        centers=poses.translation,
        wxyz=poses.rotation.as_quat(scalar_first=True),
    )
    write_tum(truth, path)
    return path


def make_project(folder: Path) -> Project:
    """`folder/project` with the recording "walk", reconstructed but not aligned, and the truth beside it."""
    count = len(frame_times_ns())
    room = make_room(points=600, images=count)
    scan = write_room(folder / "room.obj", room)
    walk = write_recording(folder / "walk")
    truth = write_truth(folder / "truth.tum", room)
    settings = Settings(
        scan=ScanEntry(path=scan, unit="m", up_axis="y"), recordings={"walk": RecordingEntry(path=walk, truth=truth)}
    )
    project = Project.create(folder / "project", settings)
    for stage in ("keyframes", "undistorted"):
        run_stage(project, stage_named(stage), "walk")
    keyframes = recording.load_keyframes(project, "walk")
    model = replace(
        room.model,
        image_names=tuple(recording.image_name(i) for i in keyframes.tolist()),
        image_camera_ids=np.ones(len(keyframes), int),
        sfm_from_camera=room.model.sfm_from_camera[keyframes],
        frame_indices=keyframes,
    )
    project.artifact("walk", "reconstruction").write_arrays(
        inputs.model_arrays([model]), options={}, inputs=recording.reconstruction_inputs(project, "walk")
    )
    return project


def click(project: Project, in_scan: np.ndarray, in_sfm: np.ndarray | None = None) -> None:
    """Keypoints at places of the scan; on the other side where these truly are, or at places given."""
    room = make_room(points=1, images=1)
    there = room.scan_from_sfm.inverse().apply(in_scan) if in_sfm is None else in_sfm
    pairs = [
        KeypointPair(f"k{i}", f"corner {i}", tuple(scan), tuple(sfm))
        for i, (scan, sfm) in enumerate(zip(in_scan.tolist(), there.tolist(), strict=True), start=1)
    ]
    project.save_keypoints("walk", KeypointSet(tuple(pairs)))


def contents(folder: Path) -> dict[str, str]:
    """What every file below a folder holds, but for the lock, hashes remembered and sentences of failures."""
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
        and path.name not in (".lock", ".settings.lock", ".hashes.json")
        and not path.name.endswith(".failed.json")
    }
