"""Which layers have something to show: the others are not offered."""

from __future__ import annotations

from gazeloc_app.data import ProjectData
from gazeloc_app.state import AppState, Layer


def layers_with_contents(data: ProjectData, state: AppState) -> tuple[Layer, ...]:
    """Of all layers those that would show something once they are visible, in their order."""
    scan, tags = data.scan(), data.scan_tags()
    has = {
        Layer.SCAN: True,
        Layer.GRID: True,
        Layer.PEOPLE: True,
        Layer.PHONE: bool(scan.frames),
        Layer.SCAN_TAGS: tags is not None and len(tags.tag_id) > 0,
    }
    if state.recording:
        has |= _of_recording(data, state)
    return tuple(layer for layer in Layer if has.get(layer, False))


def _of_recording(data: ProjectData, state: AppState) -> dict[Layer, bool]:
    name = state.recording
    tags, model, truth = data.sfm_tags(name), data.model(name), data.truth(name)
    trajectory = data.trajectory(name, data.poses_key(name, state.annotation))
    has_poses = trajectory is not None and bool(trajectory.has_pose.any())
    compared = any(data.poses_key(name, state.annotation, method) for method in state.layers.compared)
    return {
        Layer.POINTS: model is not None,
        Layer.SFM_TAGS: tags is not None and len(tags.tag_id) > 0,
        Layer.TAG_POINTS: model is not None and data.seen_tags(name) is not None,
        Layer.TRUTH: truth is not None,
        Layer.ESTIMATE: has_poses or compared,
        Layer.GAZE: has_poses and data.recording(name).gaze is not None,
        Layer.ERRORS: has_poses and truth is not None,
        Layer.KEYPOINTS: True,
    }
