"""The truth of a made-up capture, in files that no stage reads: poses, tag corners, gaze hits, the exact room."""

from __future__ import annotations

import json
from collections.abc import Sequence
from decimal import Decimal
from pathlib import Path

import numpy as np
from scipy.spatial.transform import RigidTransform

from gazeloc_core.arrays import Ints
from gazeloc_core.scan import Mesh
from gazeloc_core.synthesis.gaze import GazeTruth
from gazeloc_core.synthesis.tags import FAMILY, PlacedTag

CORNER_ORDER = [
    "corner 3 ----- corner 2     seen from the front, the tag upright",
    "   |               |        corners are the outer edge of the black border",
    "corner 0 ----- corner 1     the order is that of the AprilTag library",
]


def seconds_text(timestamp_ns: int) -> str:
    """Nanoseconds as seconds with nine decimals; no digit is lost."""
    return f"{timestamp_ns // 1_000_000_000}.{timestamp_ns % 1_000_000_000:09d}"


def tum_text(times: Sequence[str], poses: RigidTransform) -> str:
    """TUM lines `timestamp_s tx ty tz qx qy qz qw` of `scan_from_camera`."""
    lines = ["# timestamp_s tx ty tz qx qy qz qw (scan_from_camera)"]
    quaternions = poses.rotation.as_quat(canonical=True)
    for time, t, q in zip(times, poses.translation.tolist(), quaternions.tolist(), strict=True):
        lines.append(" ".join([time, *(f"{v:.9f}" for v in (*t, *q))]))
    return "\n".join(lines) + "\n"


def write_glasses(file: Path, timestamp_ns: Ints, poses: RigidTransform) -> None:
    """`glasses.tum`, by the recording's clock."""
    file.write_text(tum_text([seconds_text(t) for t in timestamp_ns.tolist()], poses))


def write_phone(file: Path, seconds: Sequence[float], poses: RigidTransform) -> None:
    """`phone.tum`, by the frames' `time`."""
    file.write_text(tum_text([f"{Decimal(repr(float(t))):.9f}" for t in seconds], poses))


def write_tags(folder: Path, tags: Sequence[PlacedTag], size_m: float) -> None:
    """`tags.json`."""
    value = {
        "family": FAMILY,
        "size_m": size_m,
        "corner_order": CORNER_ORDER,
        "tags": [{"id": tag.tag_id, "corners": np.round(tag.corners, 7).tolist()} for tag in tags],
    }
    (folder / "tags.json").write_text(json.dumps(value, indent=1))


def write_gaze(file: Path, gaze: GazeTruth) -> None:
    """`gaze3d.csv`: where the person truly looked, without the tracker's error."""
    lines = ["timestamp [ns],hit x [m],hit y [m],hit z [m],kind"]
    kinds = np.where(gaze.blink_id > 0, "blink", np.where(gaze.fixation_id > 0, "fixation", "saccade"))
    for t, hit, kind in zip(gaze.timestamp_ns.tolist(), gaze.hit.tolist(), kinds.tolist(), strict=True):
        lines.append(f"{t},{hit[0]:.4f},{hit[1]:.4f},{hit[2]:.4f},{kind}")
    file.write_text("\n".join(lines) + "\n")


def write_room(file: Path, mesh: Mesh) -> None:
    """The exact surfaces as a binary PLY, vertices in single precision."""
    header = (
        "ply\nformat binary_little_endian 1.0\ncomment exact surfaces in scan coordinates, metres\n"
        f"element vertex {len(mesh.vertices)}\nproperty float x\nproperty float y\nproperty float z\n"
        f"element face {len(mesh.faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    faces = np.empty(len(mesh.faces), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, mesh.faces
    file.write_bytes(header.encode() + mesh.vertices.astype("<f4").tobytes() + faces.tobytes())
