"""Exports, read back by programs that are not ours, or by geometry."""

import json
from dataclasses import replace
from decimal import Decimal

import cv2
import numpy as np
import pandas as pd
import pycolmap
import pytest
from box_room import PINHOLE, SIZE, TAG_SIZE_M, camera_poses, make_room, true_tag_corners
from evo.core import metrics
from evo.core.trajectory import PosePath3D
from evo.tools import file_interface

from gazeloc_core.errors import GeometryError, InputError
from gazeloc_core.evaluation.truth import read_tum
from gazeloc_core.export.colmap import write_colmap
from gazeloc_core.export.gaze3d_csv import write_gaze3d_csv
from gazeloc_core.export.nerfstudio import registered_frames, write_nerfstudio
from gazeloc_core.export.poses_csv import write_poses_csv
from gazeloc_core.export.tum import TumOptions, write_tum
from gazeloc_core.gaze import GazeInScan
from gazeloc_core.sfm_model import PlacedModel
from gazeloc_core.trajectory import Trajectory

TIMES = 1_700_000_000_123_456_789 + 33_333_333 * np.arange(6)
STATUS = ["registered", "interpolated", "none", "rejected", "tag_only", "registered"]
WITH_POSE = [0, 1, 4, 5]


def make_trajectory() -> Trajectory:
    is_keyframe = np.array([True, False, True, True, True, True])
    return Trajectory.from_poses(TIMES, np.array(STATUS), is_keyframe, np.array(WITH_POSE), camera_poses(4))


def pixel_error(camera_from_scan_rows, matrix, truth_pose) -> float:
    """Largest distance in px of the true tag corners seen by an exported and by the true camera."""
    corners = true_tag_corners().corners.reshape(-1, 3)
    in_truth = (corners - truth_pose.translation) @ truth_pose.rotation.as_matrix()
    ahead = in_truth[:, 2] > 0.3
    in_export = corners @ camera_from_scan_rows[:, :3].T + camera_from_scan_rows[:, 3]
    expected = in_truth[ahead] @ PINHOLE.matrix.T
    found = in_export[ahead] @ matrix.T
    assert ahead.any()
    return float(np.abs(expected[:, :2] / expected[:, 2:] - found[:, :2] / found[:, 2:]).max())


def test_tracked_frames_are_exported_as_such_but_training_sees_keyframes_alone(tmp_path):
    trajectory = make_trajectory()
    tracked = replace(trajectory, status=np.where(trajectory.status == "interpolated", "tracked", trajectory.status))
    write_poses_csv(tracked, tmp_path / "poses.csv")
    assert pd.read_csv(tmp_path / "poses.csv")["status"][1] == "tracked"
    write_tum(tracked, tmp_path / "poses.tum", TumOptions(registered_only=True))
    assert len(read_tum(tmp_path / "poses.tum")[0]) == len(WITH_POSE)
    assert registered_frames(tracked) == [0, 4, 5]


def test_poses_csv_has_every_frame_and_poses_only_where_there_are(tmp_path):
    assert write_poses_csv(make_trajectory(), tmp_path / "poses.csv") == [tmp_path / "poses.csv"]
    table = pd.read_csv(tmp_path / "poses.csv")
    expected = "timestamp [ns],frame index,status,tx [m],ty [m],tz [m],qw,qx,qy,qz,mark,note,agreement,"
    expected += "shift [m],shift sigma [m],turn [deg],turn sigma [deg]"
    assert ",".join(table.columns) == expected
    assert table[["mark", "note", "agreement"]].isna().all(axis=None)
    assert table["timestamp [ns]"].tolist() == TIMES.tolist()
    assert table["status"].tolist() == STATUS
    assert table["frame index"].tolist() == list(range(6))
    assert np.flatnonzero(table["tx [m]"].notna()).tolist() == WITH_POSE
    posed = table.iloc[WITH_POSE]
    np.testing.assert_allclose(posed[["tx [m]", "ty [m]", "tz [m]"]], camera_poses(4).translation, atol=1e-8)
    quaternions = camera_poses(4).rotation.as_quat(canonical=True, scalar_first=True)
    np.testing.assert_allclose(posed[["qw", "qx", "qy", "qz"]], quaternions, atol=1e-8)


def test_evo_reads_the_tum_file_and_finds_no_error(tmp_path):
    write_tum(make_trajectory(), tmp_path / "poses.tum")
    read = file_interface.read_tum_trajectory_file(tmp_path / "poses.tum")
    truth = PosePath3D(poses_se3=list(camera_poses(4).as_matrix()))
    error = metrics.APE(metrics.PoseRelation.full_transformation)
    error.process_data((truth, PosePath3D(poses_se3=list(read.poses_se3))))
    assert error.get_statistic(metrics.StatisticsType.max) < 1e-7
    assert read.check()[0]
    np.testing.assert_allclose(read.timestamps, TIMES[WITH_POSE] / 1e9, atol=1e-6)


def test_tum_times_are_exact_to_the_nanosecond(tmp_path):
    write_tum(make_trajectory(), tmp_path / "poses.tum", TumOptions(registered_only=True))
    lines = [line.split() for line in (tmp_path / "poses.tum").read_text().splitlines() if not line.startswith("#")]
    assert [int(Decimal(line[0]) * 10**9) for line in lines] == TIMES[[0, 4, 5]].tolist()
    assert {len(line[0].split(".")[1]) for line in lines} == {9}
    assert read_tum(tmp_path / "poses.tum")[0].tolist() == TIMES[[0, 4, 5]].tolist()


def test_pycolmap_reads_the_model_in_scan_coordinates(tmp_path):
    room = make_room(points=300, images=6)
    files = write_colmap([PlacedModel(room.model, room.scan_from_sfm)], tmp_path / "model")
    assert all(path.is_file() for path in files)
    model = pycolmap.Reconstruction(tmp_path / "model")
    assert sorted(image.name for image in model.images.values()) == sorted(room.model.image_names)
    points = np.array([point.xyz for point in model.points3D.values()])
    assert len(points) == 300
    assert (np.abs(points) <= SIZE / 2 + 1e-6).all()
    on_wall_or_furniture = (np.abs(np.abs(points) - SIZE / 2) < 1e-6).any(axis=1)
    assert on_wall_or_furniture.mean() > 0.8
    for image in model.images.values():
        truth = room.scan_from_camera[room.model.image_names.index(image.name)]
        camera = model.cameras[image.camera_id]
        assert pixel_error(image.cam_from_world().matrix(), camera.calibration_matrix(), truth) < 1e-3


def test_nerfstudio_cameras_see_the_tags_where_they_are(tmp_path):
    """By algebra of our own: world from OpenGL camera, whose y points up and z backwards."""
    trajectory = make_trajectory()
    pictures = [(i, np.full((PINHOLE.height, PINHOLE.width, 3), (200, 30 * i, 10), np.uint8)) for i in (0, 1, 4, 5)]
    files = write_nerfstudio(trajectory, PINHOLE, tmp_path, undistorted=pictures)
    value = json.loads((tmp_path / "transforms.json").read_text())
    assert [frame["frame_index"] for frame in value["frames"]] == [0, 4, 5] == registered_frames(trajectory)
    assert len(files) == 4
    matrix = np.array([[value["fl_x"], 0, value["cx"]], [0, value["fl_y"], value["cy"]], [0, 0, 1]])
    for frame in value["frames"]:
        scan_from_gl = np.array(frame["transform_matrix"])
        up_in_scan, back_in_scan = scan_from_gl[:3, 1], scan_from_gl[:3, 2]
        truth = trajectory.pose(frame["frame_index"])
        assert truth is not None
        assert up_in_scan[1] > 0.8  # heads are upright in this room
        np.testing.assert_allclose(back_in_scan, -truth.rotation.as_matrix()[:, 2], atol=1e-8)
        rows = np.diag([1.0, -1.0, -1.0]) @ np.linalg.inv(scan_from_gl)[:3]
        assert pixel_error(rows, matrix, truth) < 1e-3
        assert (tmp_path / frame["file_path"]).is_file()
    picture = cv2.imread(str(tmp_path / value["frames"][1]["file_path"]))
    assert picture[5, 5].tolist() == [10, 120, 200]


def test_nerfstudio_refuses_what_it_cannot_say(tmp_path):
    trajectory = make_trajectory()
    with pytest.raises(InputError, match="no undistorted picture"):
        write_nerfstudio(trajectory, PINHOLE, tmp_path, undistorted=[])
    with pytest.raises(InputError, match="its camera 1088x1080"):
        write_nerfstudio(trajectory, PINHOLE, tmp_path, undistorted=[(0, np.zeros((4, 4, 3), np.uint8))])
    nothing = Trajectory.from_poses(TIMES, np.array(["none"] * 6), np.ones(6, bool), np.zeros(0, int), None)
    with pytest.raises(GeometryError, match="No frame"):
        write_nerfstudio(nothing, PINHOLE, tmp_path, file_paths={})
    assert list(tmp_path.iterdir()) == []


def test_gaze3d_csv_has_every_sample(tmp_path):
    nan = np.full(3, np.nan)
    gaze = GazeInScan(
        timestamp_ns=TIMES[:3],
        origin=np.array([[0, 1, 2], [0, 1, 2], nan]),
        direction=np.array([[1, 0, 0], [0, 0, 1], nan]),
        hit=np.array([[2.5, 1, 2], nan, nan]),
        distance_m=np.array([2.5, np.nan, np.nan]),
        face=np.array([7, -1, -1]),
        status=np.array(["hit", "miss", "no_pose"]),
        fixation_id=np.array([3, 0, 0]),
    )
    write_gaze3d_csv(gaze, tmp_path / "gaze3d.csv")
    table = pd.read_csv(tmp_path / "gaze3d.csv")
    assert table["timestamp [ns]"].tolist() == TIMES[:3].tolist()
    assert table["status"].tolist() == ["hit", "miss", "no_pose"]
    assert table["face id"].dropna().tolist() == [7]
    assert table["fixation id"].dropna().tolist() == [3]
    columns = ["origin x [m]", "origin y [m]", "origin z [m]"]
    assert table[columns].notna().all(axis=1).tolist() == [True, True, False]
    hit = table.iloc[0]
    assert [hit["hit x [m]"], hit["hit y [m]"], hit["hit z [m]"], hit["hit distance [m]"]] == [2.5, 1, 2, 2.5]


def write_any(kind: str, folder, **options):
    trajectory, room = make_trajectory(), make_room(points=60, images=3)
    if kind == "csv":
        return write_poses_csv(trajectory, folder / "poses.csv", **options)
    if kind == "tum":
        return write_tum(trajectory, folder / "poses.tum", **options)
    if kind == "colmap":
        return write_colmap([PlacedModel(room.model, room.scan_from_sfm)], folder, **options)
    paths = {i: f"images/{i}.png" for i in range(6)}
    return write_nerfstudio(trajectory, PINHOLE, folder, file_paths=paths, **options)


FOREIGN = {"csv": "poses.csv", "tum": "poses.tum", "colmap": "cameras.bin", "nerfstudio": "transforms.json"}


@pytest.mark.parametrize("kind", FOREIGN)
def test_our_own_files_are_replaced_and_foreign_ones_are_not(tmp_path, kind):
    folder = tmp_path / "out" / "deeper"
    first = write_any(kind, folder)
    assert write_any(kind, folder) == first
    assert sorted(path for path in folder.rglob("*") if path.is_file()) == sorted(first)  # no temporary file stays
    other = tmp_path / "other"
    other.mkdir()
    (other / FOREIGN[kind]).write_text("{}" if kind == "nerfstudio" else "mine")
    with pytest.raises(InputError, match="did not write"):
        write_any(kind, other)
    assert (other / FOREIGN[kind]).read_text() in ("{}", "mine")
    assert len(list(other.iterdir())) == 1
    write_any(kind, other, overwrite=True)
    assert (other / FOREIGN[kind]).read_bytes() not in (b"{}", b"mine")


@pytest.mark.parametrize("kind", FOREIGN)
def test_a_file_where_the_folder_should_be_is_a_sentence(tmp_path, kind):
    (tmp_path / "out").write_text("a file")
    with pytest.raises(InputError, match="choose another output folder"):
        write_any(kind, tmp_path / "out")


def test_tag_size_is_that_of_the_room():
    edges = np.linalg.norm(np.diff(true_tag_corners().corners, axis=1), axis=2)
    np.testing.assert_allclose(edges, TAG_SIZE_M)
