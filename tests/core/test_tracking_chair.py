"""Tracking on a real phone's pictures, half a second apart, against the phone's own poses.

Every other picture plays an image of a reconstruction: corners in it, put on the scan's mesh by ARKit's pose. The ones
between are tracked. Nothing here was made by the code that is tested.
"""

from pathlib import Path

import cv2
import numpy as np
import pytest
from data import SHARED, needs_shared
from scipy.spatial.transform import RigidTransform

from gazeloc_core.evaluation.evaluate import pose_errors
from gazeloc_core.evaluation.protocol import write_recording
from gazeloc_core.localize.sfm import LocalizeSfmOptions, localize_sfm
from gazeloc_core.localize.tracking import track_frames
from gazeloc_core.readers import open_recording, open_scan
from gazeloc_core.recording import Recording
from gazeloc_core.sfm_model import PlacedModel, SfmModel
from gazeloc_core.surfaces.raycast import Raycaster
from gazeloc_core.transforms import Similarity

CORNERS = 500


def model_on_the_mesh(recording: Recording, images: list[int], poses: RigidTransform, raycaster: Raycaster) -> SfmModel:
    """What a reconstruction in the scan's own frame would say: corners of the images, where they are on the mesh."""
    points, image_of, pixels = [], [], []
    for number, (_, rgb) in enumerate(recording.frames.iterate(images)):
        grey = cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY)
        found = cv2.goodFeaturesToTrack(grey, CORNERS, 0.01, 15)[:, 0].astype(float) + 0.5
        pose = poses[images[number]]
        hits = raycaster.cast(pose.translation, recording.camera.unproject(found) @ pose.rotation.as_matrix().T)
        points.append(raycaster.points(hits)[hits.is_hit])
        pixels.append(found[hits.is_hit])
        image_of.append(np.full(int(hits.is_hit.sum()), number))
    in_scan = np.concatenate(points)
    count = len(in_scan)
    return SfmModel(
        cameras={1: recording.camera},
        image_names=tuple(f"frame_{index:06d}.jpg" for index in images),
        image_camera_ids=np.ones(len(images), int),
        sfm_from_camera=poses[images],
        frame_indices=np.array(images),
        points=in_scan,
        point_colors=np.zeros((count, 3), np.uint8),
        point_errors_px=np.ones(count),
        track_lengths=np.full(count, 2),
        observation_point=np.arange(count),
        observation_image=np.concatenate(image_of),
        observation_px=np.concatenate(pixels),
    )


@needs_shared
@pytest.mark.slow
def test_real_frames_are_tracked_better_than_interpolated(tmp_path: Path):
    scan = open_scan(SHARED / "3dscannerapp_chair" / "chair_scan", colored=False)
    frames = scan.frames_with_images
    write_recording(tuple(frames), tmp_path / "recording")
    recording = open_recording(tmp_path / "recording")
    poses = RigidTransform.concatenate([frame.scan_from_camera for frame in frames])
    images = list(range(0, len(frames), 2))
    model = model_on_the_mesh(recording, images, poses, Raycaster(scan.mesh))
    is_taken = np.isin(np.arange(len(frames)), images)
    tracking = track_frames(model, recording, is_taken)
    tracked = tracking.tracked.frame_indices
    assert len(tracked) >= 10
    rotation_deg, position_m = pose_errors(tracking.tracked.sfm_from_camera, poses[tracked])
    assert np.median(rotation_deg) < 0.2
    assert np.median(position_m) < 0.01  # the mesh itself is a centimetre off
    placed = [PlacedModel(model, Similarity.identity())]
    interpolated = localize_sfm(recording.timestamp_ns, np.array(images), placed, LocalizeSfmOptions(max_gap_s=2))
    between = tracked[interpolated.has_pose[tracked]]
    before_deg, before_m = pose_errors(interpolated.poses(between), poses[between])
    assert np.median(rotation_deg) < 0.2 * np.median(before_deg)
    assert np.median(position_m) < 0.5 * np.median(before_m)
