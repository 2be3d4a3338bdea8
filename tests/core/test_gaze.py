"""Gaze falls on the true place of the room, and says why where it does not."""

from pathlib import Path

import numpy as np
import pytest
from box_room import GLASSES, TAG_SIZE_M, camera_poses, room_mesh, true_tag_corners

from gazeloc_core.errors import Cancelled, InputError
from gazeloc_core.frames.sources import ImageFrames
from gazeloc_core.gaze import GazeOptions, GazeStatus, cast_gaze
from gazeloc_core.recording import Gaze, Recording
from gazeloc_core.scan import Mesh
from gazeloc_core.surfaces.raycast import Raycaster
from gazeloc_core.trajectory import Trajectory

START_NS = 1_700_000_000_000_000_000
STEP_NS = 50_000_000
COUNT = 40


@pytest.fixture(scope="module")
def raycaster():
    return Raycaster(room_mesh())


def make_trajectory(has_pose=None) -> Trajectory:
    has_pose = np.ones(COUNT, bool) if has_pose is None else has_pose
    status = np.where(has_pose, "registered", "none")
    frames = np.flatnonzero(has_pose)
    poses = camera_poses(COUNT)[frames]
    return Trajectory.from_poses(START_NS + STEP_NS * np.arange(COUNT), status, has_pose, frames, poses)


def make_recording(gaze: Gaze | None) -> Recording:
    frames = ImageFrames(tuple(Path(f"{i}.jpg") for i in range(COUNT)), GLASSES)
    return Recording(Path("room"), "test", GLASSES, START_NS + STEP_NS * np.arange(COUNT), frames, gaze)


def gaze_at(timestamp_ns, pixels, **fields) -> Recording:
    return make_recording(Gaze(np.asarray(timestamp_ns), np.asarray(pixels, float), **fields))


def test_looking_at_a_tag_hits_the_tag(raycaster):
    """The pixel of every tag centre that a frame sees, through the distorted lens, leads back to that centre."""
    trajectory, poses, centers = make_trajectory(), camera_poses(COUNT), true_tag_corners().centers
    stamps, pixels, truth = [], [], []
    for frame in range(COUNT):
        in_camera = poses[frame].inv().apply(np.array(centers))
        ahead = in_camera[:, 2] > 0.5 * np.linalg.norm(in_camera, axis=1)  # within 60 degrees
        found = GLASSES.project(in_camera)
        for tag in np.flatnonzero(ahead & GLASSES.contains(found)):
            stamps.append(trajectory.timestamp_ns[frame])
            pixels.append(found[tag])
            truth.append(centers[tag])
    assert len(truth) > 20
    result = cast_gaze(gaze_at(stamps, pixels), trajectory, raycaster)
    origins = poses.translation[(result.timestamp_ns - START_NS) // STEP_NS]
    # Furniture may stand before a tag: then the hit lies on the same ray, nearer.
    distance = np.linalg.norm(np.array(truth) - origins, axis=1)
    free = result.distance_m > distance - TAG_SIZE_M
    assert result.is_hit.all()
    assert free.mean() > 0.7
    np.testing.assert_allclose(result.hit[free], np.array(truth)[free], atol=2e-4)
    np.testing.assert_allclose(result.origin, origins, atol=1e-9)
    np.testing.assert_allclose(result.hit, result.origin + result.distance_m[:, None] * result.direction, atol=2e-4)


def test_each_status_has_its_reason_and_only_hits_have_points(raycaster):
    has_pose = np.ones(COUNT, bool)
    has_pose[10:20] = False  # a gap of 0.55 s
    middle = GLASSES.principal_point_px
    times = START_NS + STEP_NS * np.array([-1, 2, 3, 4, 15, 39, 41])
    pixels = [middle, middle, [np.nan, np.nan], middle, middle, middle, middle]
    worn = np.array([True, True, True, False, True, True, True])
    fixation = np.array([0, 1, 0, 0, 2, 3, 0])
    recording = gaze_at(times, pixels, worn=worn, fixation_id=fixation)
    result = cast_gaze(recording, make_trajectory(has_pose), raycaster)
    assert result.status.tolist() == ["no_pose", "hit", "no_gaze", "not_worn", "no_pose", "hit", "no_pose"]
    assert result.counts() == {"hit": 2, "miss": 0, "no_pose": 3, "no_gaze": 1, "not_worn": 1}
    for column in (result.hit, result.origin, result.direction, result.distance_m[:, None]):
        np.testing.assert_array_equal(np.isfinite(column).all(axis=1), result.is_hit)
    assert ((result.face >= 0) == result.is_hit).all()
    np.testing.assert_array_equal(result.fixation_id, fixation)


def test_a_miss_keeps_its_ray():
    wall = room_mesh()
    floor = wall.faces[(wall.vertices[wall.faces][:, :, 1] < -1.2).all(axis=1)]
    upwards = Raycaster(Mesh(wall.vertices, floor))
    result = cast_gaze(gaze_at([START_NS], [[544.0, 5.0]]), make_trajectory(), upwards)
    assert result.status.tolist() == [GazeStatus.MISS.value]
    assert np.isfinite(result.direction).all()
    assert not np.isfinite(result.hit).any()
    assert result.face.tolist() == [-1]


def test_between_frames_the_pose_is_between_them(raycaster):
    times = START_NS + STEP_NS * 3 + np.array([0, 12_500_000, 50_000_000])
    result = cast_gaze(gaze_at(times, [[544, 558]] * 3), make_trajectory(), raycaster)
    expected = 0.75 * result.origin[0] + 0.25 * result.origin[2]
    np.testing.assert_allclose(result.origin[1], expected, atol=1e-9)


def test_a_gap_is_bridged_only_where_allowed(raycaster):
    has_pose = np.ones(COUNT, bool)
    has_pose[10:20] = False
    recording = gaze_at([START_NS + STEP_NS * 15], [[544, 558]])
    assert not cast_gaze(recording, make_trajectory(has_pose), raycaster).is_hit.any()
    assert cast_gaze(recording, make_trajectory(has_pose), raycaster, GazeOptions(max_gap_s=0.6)).is_hit.all()


def test_no_pose_at_all_gives_no_hit(raycaster):
    nothing = make_trajectory(np.zeros(COUNT, bool))
    result = cast_gaze(gaze_at([START_NS], [[544, 558]]), nothing, raycaster)
    assert result.status.tolist() == ["no_pose"]


def test_chunks_change_nothing_and_report_progress(raycaster):
    rng = np.random.default_rng(0)
    times = np.sort(rng.integers(START_NS, START_NS + STEP_NS * (COUNT - 1), 500))
    recording = gaze_at(times, rng.uniform(300, 700, (500, 2)))
    fractions: list[float] = []
    whole = cast_gaze(recording, make_trajectory(), raycaster)
    parts = cast_gaze(
        recording, make_trajectory(), raycaster, GazeOptions(chunk=64), lambda f, text="": fractions.append(f)
    )
    np.testing.assert_array_equal(whole.hit, parts.hit)
    assert fractions == sorted(fractions)
    assert len(fractions) == 9


def test_it_can_be_cancelled(raycaster):
    def report(fraction, text=""):
        raise Cancelled("stopped")

    with pytest.raises(Cancelled):
        cast_gaze(gaze_at([START_NS], [[544, 558]]), make_trajectory(), raycaster, report=report)


def test_a_recording_without_gaze_is_a_sentence(raycaster):
    with pytest.raises(InputError, match="no gaze"):
        cast_gaze(make_recording(None), make_trajectory(), raycaster)
