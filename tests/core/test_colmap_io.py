"""COLMAP models: the same as pycolmap reads them, joined to the right frames or refused."""

import numpy as np
import pycolmap
import pytest
from scipy.spatial.transform import RigidTransform, Rotation
from tiny_captures import frame_times_ns, write_colmap, write_csv, write_image_folder, write_recording

from gazeloc_core.camera import Camera
from gazeloc_core.errors import InputError
from gazeloc_core.readers import open_recording
from gazeloc_core.sfm.colmap_io import find_model, join_to_recording, read_model, write_model
from gazeloc_core.sfm.colmap_join import check_same_camera
from gazeloc_core.sfm_model import SfmModel


@pytest.mark.parametrize("kind", ["binary", "text"])
@pytest.mark.parametrize("with_rigs", [True, False])
def test_a_model_reads_as_pycolmap_reads_it(tmp_path, kind, with_rigs):
    write_colmap(tmp_path, kind)
    if not with_rigs:  # as COLMAP wrote it before version 3.12
        for name in ("rigs", "frames"):
            (tmp_path / f"{name}.{'bin' if kind == 'binary' else 'txt'}").unlink()
    referee, model = pycolmap.Reconstruction(str(tmp_path)), read_model(tmp_path)
    image_ids, point_ids = sorted(referee.images), sorted(referee.points3D)
    assert model.image_names == tuple(referee.images[i].name for i in image_ids)
    poses = [np.vstack([referee.images[i].cam_from_world().inverse().matrix(), [0, 0, 0, 1]]) for i in image_ids]
    np.testing.assert_allclose(model.sfm_from_camera.as_matrix(), poses, atol=1e-12)
    np.testing.assert_allclose(model.points, [referee.points3D[i].xyz for i in point_ids])
    np.testing.assert_array_equal(model.point_colors, [referee.points3D[i].color for i in point_ids])
    assert list(model.track_lengths) == [referee.points3D[i].track.length() for i in point_ids]
    assert (model.frame_indices == -1).all()
    camera = model.camera_of(0)
    np.testing.assert_allclose(camera.params, referee.cameras[model.image_camera_ids[0]].params)


@pytest.mark.parametrize("kind", ["binary", "text"])
def test_observations_are_where_their_points_project(tmp_path, kind):
    model = read_model(write_colmap(tmp_path, kind))
    assert len(model.observation_px) == model.track_lengths.sum() > 0
    for image in range(len(model)):
        mine = model.observation_image == image
        camera_from_sfm = model.sfm_from_camera[image].inv().as_matrix()
        points = model.points[model.observation_point[mine]] @ camera_from_sfm[:3, :3].T + camera_from_sfm[:3, 3]
        np.testing.assert_allclose(model.camera_of(image).project(points), model.observation_px[mine], atol=1e-6)


def test_a_written_model_is_read_by_pycolmap_and_by_us(tmp_path):
    camera = Camera.pinhole(640, 480, 500, 510, 320, 241)
    poses = RigidTransform.from_components([[1, 2, 3], [4, 5, 6.5]], Rotation.from_rotvec([[0.1, 0.2, 0.3], [1, 0, 0]]))
    points, colors = np.array([[0.0, 1, 2], [3, 4, 5]]), np.array([[1, 2, 3], [250, 251, 252]], np.uint8)
    write_model(tmp_path, {7: camera}, ("a/x.jpg", "b.jpg"), np.array([7, 7]), poses, points, colors)
    referee = pycolmap.Reconstruction(str(tmp_path))
    np.testing.assert_allclose(referee.images[2].projection_center(), [4, 5, 6.5])
    model = read_model(tmp_path)
    assert model.image_names == ("a/x.jpg", "b.jpg")
    np.testing.assert_allclose(model.sfm_from_camera.as_matrix(), poses.as_matrix(), atol=1e-12)
    np.testing.assert_array_equal(model.points, points)
    np.testing.assert_array_equal(model.point_colors, colors)


@pytest.mark.parametrize("name", ["cameras.bin", "images.bin", "points3D.bin"])
def test_a_model_cut_off_anywhere_is_refused_with_the_byte(tmp_path, name):
    whole = (write_colmap(tmp_path) / name).read_bytes()
    for length in sorted({0, 1, 7, 8, 9, *np.linspace(10, len(whole) - 1, 40).astype(int)}):
        (tmp_path / name).write_bytes(whole[:length])
        with pytest.raises(InputError, match=rf"{name}: .*cut off at byte {length}; "):
            read_model(tmp_path)


def test_a_model_is_found_where_colmap_puts_it(tmp_path):
    write_colmap(tmp_path / "sparse" / "0")
    assert find_model(tmp_path) == tmp_path / "sparse" / "0"


def model_of(names, camera):
    n = len(names)
    poses = RigidTransform.identity(n)
    empty = np.zeros((0, 3))
    return SfmModel(
        {1: camera}, tuple(names), np.ones(n), poses, np.full(n, -1), empty, empty, [], [], [], [], np.zeros((0, 2))
    )


@pytest.fixture
def recording(tmp_path):
    return open_recording(write_recording(tmp_path / "recording"))


def join(names, recording, csv=None):
    return list(join_to_recording(model_of(names, recording.camera), recording, recording.camera, csv))


def test_images_join_by_the_last_number_in_their_names(recording):
    assert join(["cam1/frame_000011.jpg", "x/f3_0.png", "7.jpg"], recording) == [11, 0, 7]


def test_images_join_by_a_table_of_names_and_times(recording, tmp_path):
    times = frame_times_ns()
    rows = [["b.jpg", times[4] + 900_000], ["unused.jpg", 0], ["a.jpg", times[9] - 900_000]]
    write_csv(tmp_path / "names.csv", ["name", "timestamp_ns"], rows)
    assert join(["a.jpg", "b.jpg"], recording, tmp_path / "names.csv") == [9, 4]
    rows[0][1] += 200_000
    write_csv(tmp_path / "names.csv", ["name", "timestamp_ns"], rows)
    with pytest.raises(InputError, match=r"b\.jpg at \d+ ns is 1\.1 ms off"):
        join(["a.jpg", "b.jpg"], recording, tmp_path / "names.csv")


def test_image_files_join_by_their_own_names(tmp_path):
    recording = open_recording(write_image_folder(tmp_path, ("IMG_1409.jpg", "IMG_1411.jpg", "IMG_1420.jpg")))
    assert join(["sub/IMG_1420.jpg", "IMG_1409.jpg"], recording) == [2, 0]


@pytest.mark.parametrize(
    ("names", "sentence"),
    [
        ([f"frame_{i}.jpg" for i in range(1, 13)], "it seems to count from 1"),
        (["frame_99.jpg"], "names frame 99, but .* has the frames 0 to 11"),
        (["a/f_3.jpg", "b/f_3.jpg"], "both belong to frame 3"),
        (["left.jpg"], "has no frame number"),
    ],
)
def test_names_that_leave_doubt_are_refused(recording, names, sentence):
    with pytest.raises(InputError, match=sentence):
        join(names, recording)


LENS = Camera.from_opencv(
    1088, 1080, [[766, 0, 543], [0, 766, 539], [0, 0, 1]], [-0.13, 0.11, 0, 0, 0.0, 0.17, 0.05, 0.0]
)
UNDISTORTED = Camera.pinhole(1088, 1080, 760, 760, 544, 540)


@pytest.mark.parametrize(
    "camera",
    [
        LENS,
        UNDISTORTED,
        UNDISTORTED.scaled(544, 540),
        Camera.pinhole(1088, 1080, 763, 763, 545, 541),
        Camera.pinhole(1300, 1000, 766, 766, 650, 500),  # COLMAP's undistorter keeps the focal length, not the size
    ],
)
def test_the_recordings_own_camera_is_known_again(camera):
    check_same_camera(1, camera, LENS, UNDISTORTED)


@pytest.mark.parametrize(
    ("camera", "sentence"),
    [
        (Camera.pinhole(1088, 1080, 700, 700, 544, 540), "degrees off"),
        (Camera.pinhole(1088, 1080, 760, 760, 560, 540), "degrees off"),
        (Camera.pinhole(1920, 1080, 500, 500, 960, 540), "past the border"),
        (Camera.pinhole(1920, 1080, 6000, 6000, 960, 540), "only a small part"),
        (Camera("OPENCV", 1920, 1080, np.array([900, 900, 960, 540, 0, 0, 0, 0])), "another shape"),
    ],
)
def test_another_camera_is_refused(camera, sentence):
    with pytest.raises(InputError, match=sentence):
        check_same_camera(1, camera, LENS, UNDISTORTED)
