"""The paper's protocol (section VII): frames of the phone are held out and registered as if the glasses had taken them.

    PROJECT/held_out/scan/        the scan without them: whatever a method reads of the scan, these frames are not in it
    PROJECT/held_out/recording/   their pictures, resampled to one camera as glasses have it, with their times
    PROJECT/held_out/truth.tum    their poses, as the phone reports them

The truth is as good as the phone's own tracking. The mesh, and a texture if it has one, were made by the phone from all
of its frames, the held-out ones too.
"""

from __future__ import annotations

import json
import os
import shutil
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from gazeloc_core.arrays import Bytes
from gazeloc_core.camera import HALF_PIXEL, Camera
from gazeloc_core.errors import InputError, ProjectError
from gazeloc_core.export.tum import write_tum
from gazeloc_core.progress import Report, part, silent
from gazeloc_core.project import Project, RecordingEntry, ScanEntry, Settings, TagEntry, check_new_folder
from gazeloc_core.readers import open_scan
from gazeloc_core.scan import RoomScan, ScanFrame
from gazeloc_core.storage.files import folder_replaced_atomically
from gazeloc_core.trajectory import PoseStatus, Trajectory
from gazeloc_core.transforms import wxyz_of

FOLDER = "held_out"
JPEG_QUALITY = 97
FEWEST = 3
"""No reconstruction begins with fewer pictures."""


@dataclass(frozen=True, kw_only=True)
class ProtocolOptions:
    """Which of the phone's frames are held out."""

    every: int = 2
    """Hold out the first of every so many frames that have a picture; at least 2."""
    share: float | None = None
    """Instead: hold out this share of them, between 0 and 1, chosen at random."""
    seed: int = 0
    """Chooses the random frames."""


def held_out_frames(scan: RoomScan, options: ProtocolOptions | None = None) -> tuple[ScanFrame, ...]:
    """The frames to be held out, in order of time.

    Raises:
        InputError: if the options are none, or fewer than three frames would be held out or none would stay.
    """
    options = options or ProtocolOptions()
    frames = scan.frames_with_images
    if options.share is not None:
        if not 0 < options.share < 1:
            raise InputError(f"The share to hold out is {options.share:g}; it must lie between 0 and 1.")
        count = round(options.share * len(frames))
        chosen = np.sort(np.random.default_rng(options.seed).permutation(len(frames))[:count])
    else:
        if options.every < 2:
            raise InputError(f"Every {options.every} frames cannot be held out; hold out every second or fewer.")
        chosen = np.arange(0, len(frames), options.every)
    if len(chosen) < FEWEST or len(chosen) == len(frames):
        raise InputError.of(
            scan.path,
            f"of its {len(frames)} posed frames with pictures {len(chosen)} would be held out; at least {FEWEST} must "
            "be, and some must stay",
            "hold out another share, or give a scan with more frames",
        )
    return tuple(frames[i] for i in chosen)


def make_protocol_project(
    folder: Path,
    scan: Path,
    *,
    tags: TagEntry | None = None,
    name: str = "held-out",
    options: ProtocolOptions | None = None,
    report: Report = silent,
) -> Project:
    """A new project in `folder` whose one recording is the frames held out of `scan`, with their poses as its truth.

    The folder holds all that it needs; the scan is not written to (its remaining files are linked or copied).

    Raises:
        ProjectError: if the folder is in use or cannot be written.
        InputError: for a scan that cannot be read, or that has too few posed frames with pictures.
    """
    check_new_folder(folder)
    if folder.resolve().is_relative_to(scan.resolve()):
        raise ProjectError(f"{folder}: this is inside the scan, which is not written to; name a folder elsewhere.")
    opened = open_scan(scan, colored=False, report=part(report, 0.0, 0.3))
    held = held_out_frames(opened, options)
    try:
        with folder_replaced_atomically(folder) as new:
            inside = new / FOLDER
            recording = RecordingEntry(path=inside / "recording", truth=inside / "truth.tum")
            settings = Settings(scan=ScanEntry(path=inside / "scan"), tags=tags, recordings={name: recording})
            Project.create(new, settings)
            write_scan_without(opened, held, inside / "scan")
            write_recording(held, inside / "recording", part(report, 0.3, 1.0))
            write_truth(held, inside / "truth.tum")
    except OSError as error:
        raise ProjectError(f"{folder}: the project cannot be written ({error.strerror}); name another.") from error
    return Project.open(folder)


def write_scan_without(scan: RoomScan, held: tuple[ScanFrame, ...], folder: Path) -> None:
    """The scan's folder without all files that belong to held-out frames: hard links, or copies across disks.

    Raises:
        InputError: if it is not known which files belong to a frame.
    """
    unknown = next((frame for frame in held if frame.image_path not in frame.own_files), None)
    if unknown is not None:
        problem = f"a {scan.format} does not say which files are of frame {unknown.name} alone"
        raise InputError.of(scan.path, problem, "give a scan of another format")
    left_out = {path.resolve() for frame in held for path in frame.own_files}
    for path in sorted(p for p in scan.path.rglob("*") if p.is_file()):
        if path.resolve() in left_out:
            continue
        target = folder / path.relative_to(scan.path)
        target.parent.mkdir(parents=True, exist_ok=True)
        try:
            os.link(path.resolve(), target)
        except OSError:
            shutil.copy2(path, target)


def write_recording(held: tuple[ScanFrame, ...], folder: Path, report: Report = silent) -> None:
    """The pictures as an image folder with `camera.json` and `timestamps.csv`.

    A phone refocuses, so that its focal length and principal point change by some pixels from frame to frame; glasses
    have one camera. Each picture is resampled to the camera of the middle frame, black where it saw nothing.

    Raises:
        InputError: if a picture does not decode, or a camera has distortion.
    """
    camera = held[len(held) // 2].camera
    folder.mkdir(parents=True)
    rows = ["name,timestamp_ns"]
    for number, frame in enumerate(held):
        picture = cv2.cvtColor(_resampled(frame, camera), cv2.COLOR_RGB2BGR)
        lossless = frame.image_path is not None and frame.image_path.suffix.lower() == ".png"
        path = folder / f"{frame.name}{'.png' if lossless else '.jpg'}"
        if not cv2.imwrite(str(path), picture, [] if lossless else [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]):
            raise InputError.of(path, "the picture cannot be written", "free space or name another folder")
        rows.append(f"{path.name},{frame.timestamp_ns}")
        report((number + 1) / len(held), f"Held out {number + 1} of {len(held)} frames")
    (folder / "timestamps.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    (folder / "camera.json").write_text(json.dumps(camera.to_json()), encoding="utf-8")


def write_truth(held: tuple[ScanFrame, ...], path: Path) -> None:
    """The frames' poses in the scan as TUM lines, at their own times."""
    count = len(held)
    poses = Trajectory(
        np.array([frame.timestamp_ns for frame in held]),
        np.full(count, PoseStatus.REGISTERED.value),
        np.ones(count, dtype=np.bool_),
        np.array([frame.scan_from_camera.translation for frame in held]),
        np.array([wxyz_of(frame.scan_from_camera.rotation) for frame in held]),
    )
    write_tum(poses, path)


def _resampled(frame: ScanFrame, camera: Camera) -> Bytes:
    """The picture of a frame as `camera`, at the same place, would have taken it, RGB."""
    if not (frame.camera.is_pinhole and camera.is_pinhole):
        raise InputError(f"Frame {frame.name} has a {frame.camera.model} camera; undistort the scan's pictures first.")
    to_opencv = np.array([[1, 0, -HALF_PIXEL], [0, 1, -HALF_PIXEL], [0, 0, 1]])  # which counts from a pixel's centre
    own, common = to_opencv @ frame.camera.matrix, to_opencv @ camera.matrix
    warped = cv2.warpAffine(
        frame.read_image(), (common @ np.linalg.inv(own))[:2], (camera.width, camera.height), flags=cv2.INTER_CUBIC
    )
    return np.asarray(warped, dtype=np.uint8)
