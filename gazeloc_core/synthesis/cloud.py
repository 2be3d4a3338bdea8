"""The tables of a Pupil Cloud export: info, world timestamps, gaze; pixels in OpenCV's convention, as there."""

from __future__ import annotations

import json
import uuid
from pathlib import Path

import numpy as np

from gazeloc_core.arrays import Floats
from gazeloc_core.camera import HALF_PIXEL
from gazeloc_core.synthesis.gaze import GazeTruth
from gazeloc_core.synthesis.glasses import GlassesCapture


def identifiers(seed: int) -> tuple[str, str]:
    """The ids of section and recording, the same for the same seed."""
    rng = np.random.default_rng([seed, 77])
    section, recording = (str(uuid.UUID(bytes=rng.bytes(16), version=4)) for _ in range(2))
    return section, recording


def video_name(capture: GlassesCapture, seed: int) -> str:
    """`<beginning of section id>_<start>-<end>.mp4`, the end in seconds."""
    seconds = (capture.timestamp_ns[-1] - capture.timestamp_ns[0]) / 1e9
    return f"{identifiers(seed)[0][:8]}_0.0-{seconds:.3f}.mp4"


def write_tables(folder: Path, capture: GlassesCapture, gaze: GazeTruth, seed: int) -> None:
    """`info.json`, `world_timestamps.csv` and `gaze.csv`."""
    section, recording = identifiers(seed)
    times = capture.timestamp_ns.tolist()
    _write_info(folder, recording, times[0], times[-1] - times[0])
    rows = [f"{section},{recording},{t}" for t in times]
    head = "section id,recording id,timestamp [ns]"
    (folder / "world_timestamps.csv").write_text("\n".join([head, *rows]) + "\n")
    pixels = capture.camera.project(gaze.measured) - HALF_PIXEL
    azimuth, elevation = angles_deg(gaze.measured)
    lines = [head + ",gaze x [px],gaze y [px],worn,fixation id,blink id,azimuth [deg],elevation [deg]"]
    for t, (x, y), fixation, blink, a, e in zip(
        gaze.timestamp_ns.tolist(),
        pixels.tolist(),
        gaze.fixation_id.tolist(),
        gaze.blink_id.tolist(),
        azimuth.tolist(),
        elevation.tolist(),
        strict=True,
    ):
        ids = f"{fixation or ''},{blink or ''}"
        lines.append(f"{section},{recording},{t},{x:.3f},{y:.3f},1,{ids},{a:.6f},{e:.6f}")
    (folder / "gaze.csv").write_text("\n".join(lines) + "\n")


def angles_deg(rays_in_camera: Floats) -> tuple[Floats, Floats]:
    """Azimuth, to the right, and elevation, up, of rays (N, 3), as Pupil Labs defines them."""
    x, y, z = rays_in_camera.T
    return np.degrees(np.arctan2(x, z)), np.degrees(-np.arctan2(y, np.hypot(x, z)))


def _write_info(folder: Path, recording: str, start_ns: int, duration_ns: int) -> None:
    info = {
        "android_device_id": "0",
        "android_device_model": "OnePlus 8T",
        "android_device_name": "GazeLoc scene generator",
        "app_version": "1.4.14-prod",
        "calib_version": 1,
        "data_format_version": "1.2",
        "duration": duration_ns,
        "gaze_offset": [0.0, 0.0],
        "glasses_serial_number": "made up",
        "pipeline_version": "2.8.0",
        "recording_id": recording,
        "scene_camera_serial_number": "5am9e",
        "start_time": start_ns,
        "template_data": {"id": "", "version": "", "recording_name": "studio", "data": {}},
        "wearer_id": "00000000-0000-4000-8000-000000000000",
        "wearer_name": "Nobody",
    }
    (folder / "info.json").write_text(json.dumps(info, indent=2))
