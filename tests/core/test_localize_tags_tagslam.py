"""Real tags in a long corridor (TagSLAM's test 9): our poses against TagSLAM's own trajectory.

The map of tags is TagSLAM's, so this is a test of resection by another program's answer, not of accuracy: its author
warns that some of its poses are outliers. Plain PnP over all tags of a frame, unweighed, is known to lie a median of
2.6 cm from it where a frame shows several tags.
"""

import bz2
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from data import SHARED, needs_shared
from scipy.spatial.transform import RigidTransform, Rotation

from gazeloc_core.camera import HALF_PIXEL, Camera
from gazeloc_core.evaluation.evaluate import match_times, pose_errors
from gazeloc_core.localize.resection import CameraPoses, SeenSquares, TagErrors, resect
from gazeloc_core.localize.tags import LocalizeTagsOptions, localize_tags
from gazeloc_core.tag_types import TagCorners, TagSightings
from gazeloc_core.tags.pose import normalised_corners

FOLDER = SHARED / "tagslam_test9"
SIDE_M = 0.15
pytestmark = [pytest.mark.slow, needs_shared]


def messages(folder: Path, name: str, topic: str) -> list[Any]:
    """All messages of one topic of a packed ROS bag; unpacked in `folder` meanwhile (90 MB)."""
    from rosbags.rosbag1 import Reader
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store, bag = get_typestore(Stores.ROS1_NOETIC), folder / name
    bag.write_bytes(bz2.decompress((FOLDER / f"{name}.bz2").read_bytes()))
    with Reader(bag) as reader:
        wanted = [connection for connection in reader.connections if connection.topic == topic]
        for connection in wanted:
            store.register(get_types_from_msg(connection.msgdef.data, connection.msgtype))
        found = [store.deserialize_ros1(raw, c.msgtype) for c, _, raw in reader.messages(connections=wanted)]
    bag.unlink()
    return found


def nanoseconds(message: Any) -> int:
    return int(message.header.stamp.sec) * 10**9 + int(message.header.stamp.nanosec)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Times, camera, sightings, map, and the reference with its times."""
    folder = tmp_path_factory.mktemp("tagslam")
    lens = yaml.safe_load((FOLDER / "cameras.yaml").read_text())["cam0"]
    fx, fy, cx, cy = lens["intrinsics"]
    parameters = [fx, fy, cx + HALF_PIXEL, cy + HALF_PIXEL, *lens["distortion_coeffs"]]
    camera = Camera("OPENCV_FISHEYE", *lens["resolution"], np.array(parameters))
    seen = messages(folder, "tag_detections.bag", lens["tagtopic"])
    rows = [
        (k, tag.id, [(p.x, p.y) for p in tag.corners]) for k, message in enumerate(seen) for tag in message.apriltags
    ]
    frame, tag_id, corners = (np.array(column) for column in zip(*rows, strict=True))
    sightings = TagSightings(frame, tag_id, corners + HALF_PIXEL, np.ones(len(rows)))
    stamps = np.array([nanoseconds(message) for message in seen])
    odometry = messages(folder, "reference.bag", "/tagslam/odom/body_rig")
    at = [message.pose.pose for message in odometry]
    place = np.array([[p.position.x, p.position.y, p.position.z] for p in at])
    turn = np.array([[p.orientation.x, p.orientation.y, p.orientation.z, p.orientation.w] for p in at])
    reference = RigidTransform.from_components(place, Rotation.from_quat(turn))
    return stamps, camera, sightings, tag_map(), np.array([nanoseconds(m) for m in odometry]), reference


def tag_map() -> TagCorners:
    """The places of the tags; TagSLAM's tags have y up and z out of the wall, and the detector's order of corners."""
    tags = yaml.safe_load((FOLDER / "tagslam.yaml").read_text())["bodies"][0]["top_floor"]["tags"]
    square = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * SIDE_M / 2
    corners = []
    for tag in tags:
        place, turn = (
            np.array([tag["pose"][part][axis] for axis in "xyz"], float) for part in ("position", "rotation")
        )
        corners.append(square @ Rotation.from_rotvec(turn).as_matrix().T + place)
    return TagCorners(np.array([tag["id"] for tag in tags]), np.array(corners), np.ones(len(tags)), np.zeros(len(tags)))


def test_unweighed_resection_is_as_near_to_the_reference_as_it_is_known_to_be(run):
    stamps, camera, sightings, tags, reference_ns, reference = run
    row_of = {tag_id: row for row, tag_id in enumerate(tags.tag_id.tolist())}
    mapped = np.array([tag_id in row_of for tag_id in sightings.tag_id.tolist()])
    count = np.bincount(sightings.frame_index[mapped], minlength=len(stamps))
    rows = match_times(stamps, reference_ns)
    frames = np.flatnonzero((count > 1) & (rows >= 0))
    use = np.flatnonzero(mapped & np.isin(sightings.frame_index, frames))
    views = SeenSquares(
        np.searchsorted(frames, sightings.frame_index[use]),
        tags.corners[[row_of[tag_id] for tag_id in sightings.tag_id[use].tolist()]],
        normalised_corners(sightings.corners_px[use], camera),
        camera.focal_px,
        np.ones(len(use), np.bool_),
    )
    near = reference[rows[frames]]
    start = CameraPoses(near.translation + 0.05, near.rotation.as_matrix())
    found = resect(views, start, TagErrors(place_error_m=1e-6)).poses
    assert len(frames) > 200
    assert np.median(np.linalg.norm(found.centers - near.translation, axis=1)) == pytest.approx(0.026, abs=0.003)


def test_the_method_follows_the_reference_and_names_what_it_leaves_out(run):
    stamps, camera, sightings, tags, reference_ns, reference = run
    answer = localize_tags(
        stamps, np.arange(0, len(stamps), 10), camera, sightings, tags, LocalizeTagsOptions(place_error_m=0.001)
    )
    trajectory, rows = answer.trajectory, match_times(stamps, reference_ns)
    both = np.flatnonzero(trajectory.has_pose & (rows >= 0))
    turn_deg, shift_m = pose_errors(trajectory.poses(both), reference[rows[both]])
    several = answer.tags_used[both] > 1
    assert trajectory.has_pose.sum() > 0.98 * (trajectory.status != "none").sum()
    assert len(both) > 1400
    assert np.median(shift_m) < 0.015
    assert np.median(shift_m[several]) < 0.035
    assert shift_m.max() < 0.6
    assert turn_deg.max() < 15
