"""Figures 11 to 13: each method's cameras in the room against the truth, and frames against renders from its poses."""

from __future__ import annotations

import cv2
import numpy as np

from gazeloc_core.arrays import Bytes, Ints
from gazeloc_core.camera import Camera
from gazeloc_core.evaluation.truth import read_tum
from gazeloc_core.experiments.finding import Finding
from gazeloc_core.experiments.overview import View, look_into, side_by_side, with_cameras, with_path
from gazeloc_core.experiments.workspace import Workspace
from gazeloc_core.frames.undistort import Undistorter
from gazeloc_core.methods import Method
from gazeloc_core.progress import Report, part
from gazeloc_core.project import Project
from gazeloc_core.stages import inputs
from gazeloc_core.stages.poses import fresh_methods, fresh_trajectory
from gazeloc_core.surfaces.glb import Rgb
from gazeloc_core.surfaces.render import RayRenderer
from gazeloc_core.trajectory import Trajectory
from gazeloc_core.transforms import rigid_from_wxyz

GREEN: Rgb = (20, 160, 60)
RED: Rgb = (220, 30, 40)
PICTURE_PX = 320
FRAMES = 4


def figures_11_to_13(workspace: Workspace, report: Report) -> Finding:
    """The trajectories of every method that ran, green the truth and red the estimate; renders of some frames."""
    methods = (Method.TAGS_PAPER, Method.TAGS, Method.SFM_PAPER, Method.SFM)
    project = workspace.open_project(methods, part(report, 0, 0.7))
    pictures: dict[str, Bytes] = {}
    for name in project.settings.recordings:
        report(0.8, f"drawing {name}")
        pictures[f"trajectories-{name}"] = trajectory_picture(project, name)
        pictures[f"renders-{name}"] = render_picture(project, name)
    text = (
        "Cameras of each method in the scan (figures 11 and 12): green is the truth, red the estimate. Below, frames "
        "of the recording beside renders of the scan from the poses of each method (figure 13); a method without a "
        "pose for a frame shows none. Frames were taken evenly from those that the shown methods were asked for."
    )
    return Finding(text=text, pictures=pictures)


def trajectory_picture(project: Project, recording: str) -> Bytes:
    """A picture of the room for each method that has fresh poses, side by side."""
    room = look_into(inputs.load_mesh(project), inputs.load_scan(project))
    truth = project.recording(recording).truth
    if truth is not None:
        room = with_path(room, np.asarray(read_tum(truth)[1].translation), GREEN)
    methods = fresh_methods(project, recording)
    views = [_with_estimate(room, fresh_trajectory(project, recording, method)) for method in methods]
    return side_by_side([view.rgb for view in views], list(methods), 2)


def _with_estimate(room: View, trajectory: Trajectory) -> View:
    chosen = trajectory.localised_keyframes
    if len(chosen) == 0:
        return room
    poses = rigid_from_wxyz(trajectory.wxyz[chosen].reshape(-1, 4), trajectory.centers[chosen].reshape(-1, 3))
    return with_cameras(room, poses, RED)


def render_picture(project: Project, recording: str) -> Bytes:
    """Some frames, undistorted, each beside the scan as every method's pose sees it."""
    methods = fresh_methods(project, recording)
    trajectories = {method: fresh_trajectory(project, recording, method) for method in methods}
    camera = inputs.load_undistorted_camera(project, recording)
    small = camera.scaled(PICTURE_PX, round(PICTURE_PX * camera.height / camera.width))
    opened = inputs.load_recording(project, recording)
    undistorter = Undistorter(opened.camera, camera)
    renderer = RayRenderer(inputs.load_mesh(project))
    pictures: list[Bytes] = []
    for index, rgb in opened.frames.iterate(_frames(trajectories[methods[0]]).tolist()):
        pictures.append(_fitted(undistorter.image(rgb), small))
        for method in methods:
            pose = trajectories[method].pose(index)
            blank = np.full((small.height, small.width, 3), 235, np.uint8)
            pictures.append(blank if pose is None else renderer.render(small, pose).rgb)
    labels = ["frame", *methods] * (len(pictures) // (1 + len(methods)))
    return side_by_side(pictures, labels, 1 + len(methods))


def _frames(trajectory: Trajectory) -> Ints:
    """Some keyframes, spread evenly, the ends left out."""
    keyframes = np.flatnonzero(trajectory.is_keyframe)
    at = np.linspace(0, len(keyframes) - 1, FRAMES + 2)[1:-1].round().astype(int)
    return np.unique(keyframes[at])


def _fitted(rgb: Bytes, camera: Camera) -> Bytes:
    return np.asarray(cv2.resize(rgb, (camera.width, camera.height), interpolation=cv2.INTER_AREA), dtype=np.uint8)
