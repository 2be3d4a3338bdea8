"""Made-up rooms with exact truth: a phone's scan and a glasses' recording in the layouts of real exports.

    python -m gazeloc_core.synthetic FOLDER --preset studio

writes `scan/` (3D Scanner App "All Data"), `recording/` (Pupil Cloud), `colmap/` (a COLMAP model of the recording),
`truth/` and `scene.json`; for a second route in the same scan `recording-second/` and its truth. The same options give
the same files. What is written is what a phone and glasses would write: phone poses drift, the mesh is fused from noisy
depth at those poses, the video is dim, noisy and blurred.

Scan coordinates are the frame in which the phone reports its poses; its drift has mean zero.
"""

from __future__ import annotations

import json
import sys
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import tyro

from gazeloc_core.progress import Report, part, silent
from gazeloc_core.storage.files import read_json
from gazeloc_core.synthesis import cloud, glasses, paths, phone, truth
from gazeloc_core.synthesis.fusion import fused
from gazeloc_core.synthesis.gaze import looked
from gazeloc_core.synthesis.glasses import GlassesCapture
from gazeloc_core.synthesis.model import write_model
from gazeloc_core.synthesis.room import SCAN_FROM_ROOM, Room, build_room, render
from gazeloc_core.synthesis.routes import ROUTES, RouteName
from gazeloc_core.synthesis.tags import FAMILY
from gazeloc_core.synthesis.texturing import textured, write_obj

__all__ = ["PRESETS", "Room", "SceneOptions", "build_room", "render", "scene_room", "write_scene"]


@dataclass(frozen=True, kw_only=True)
class SceneOptions:
    """What a made-up capture is like. The defaults are the preset `studio`."""

    seed: int = 1
    """Seed of everything random."""
    tag_ids: tuple[int, ...] = (0, 1, 2, 3, 4, 5, 6, 7)
    """Which tags are in the room; each has its place (`room.TAG_PLACES`)."""
    tag_size_m: float = 0.16
    """Distance between the corners that the detector reports, in metres."""
    bare: bool = False
    """Leave out most of the furniture and all pictures."""
    light_rays: int = 49
    """Rays per point and light when the soft light is baked."""
    light_spacing_m: float = 0.05
    """Distance of the points at which light is baked, in metres."""
    texel_scale: float = 1.0
    """Coarseness of the room's own textures; above 1 for scenes that are made quickly."""
    phone_frames: int = 54
    """Frames of the phone's capture."""
    phone_seconds: float = 42.0
    """Length of the phone's capture in seconds."""
    phone_size_px: tuple[int, int] = (960, 720)
    """Width and height of the phone's pictures."""
    phone_quality: int = 68
    """JPEG quality of the phone's pictures."""
    drift_m: float = 0.010
    """RMS error of the reported phone positions, in metres."""
    drift_deg: float = 0.2
    """RMS error of the reported phone rotations, in degrees."""
    voxel_m: float = 0.018
    """Voxel size of the fusion, in metres."""
    mesh_faces: int = 21_000
    """Triangles of the scan's mesh."""
    texel_m: float = 0.0033
    """Size of the texture's texels on the mesh, in metres."""
    routes: tuple[RouteName, ...] = ("first",)
    """The routes of the wearer, one recording each."""
    hurry: tuple[float, ...] = (1.0,)
    """How many times as fast as at ease the wearer walks and turns the head, by route; the last goes for the rest."""
    glasses_seconds: float = 21.0
    """Length of each recording in seconds; a hurried walk ends sooner (`WALK_SECONDS`)."""
    glasses_hz: float = 30.0
    """Mean frame rate of the scene video."""
    glasses_size_px: tuple[int, int] = glasses.SIZE
    """Width and height of the scene video."""
    glasses_exposure_s: float = 0.008
    """Exposure time of a video frame in seconds: longer blurs more."""
    glasses_gain: float = 0.62
    """Brightness of the video; the phone's pictures have 1.45."""
    video_crf: int = 27
    """Quality of the H.264 encoder, lower is better and larger."""
    model_stride: int = 12
    """Every how many frames one goes into the COLMAP model; 0 writes none."""
    exact_room: bool = False
    """Write the exact surfaces of the room to truth/room.ply (0.6 MB)."""


_LATER = ("routes", "hurry")
"""Options that `scene.json` only names where they are not the default: its files of before are still written alike."""

_TABLE2 = SceneOptions(routes=("first", "second"), glasses_seconds=20.0, glasses_hz=12.0, model_stride=0)
"""Two recordings in one scan; a frame rate that is made in minutes and still gives every keyframe a choice of six."""
WALK_SECONDS = 21.8
"""How long the routes take at ease."""
HARD_HURRY = (1.2, 1.5)
"""The second route turns less, so its wearer hurries more."""
_SETTING_A = replace(_TABLE2, seed=11)
_SETTING_B = replace(_TABLE2, seed=12, tag_ids=(10, 11, 12, 13, 14, 15, 16, 17), tag_size_m=0.20)


def _hard(options: SceneOptions, tag_ids: tuple[int, ...]) -> SceneOptions:
    """The same setting in a bare, dim room with few tags, for a wearer who is in a hurry."""
    return replace(
        options,
        tag_ids=tag_ids,
        bare=True,
        hurry=HARD_HURRY,
        glasses_seconds=17.0,
        glasses_gain=0.22,
        video_crf=25,
    )


PRESETS = {
    "studio": SceneOptions(),
    "tiny": SceneOptions(
        bare=True,
        light_rays=4,
        light_spacing_m=0.4,
        texel_scale=4.0,
        phone_frames=12,
        phone_seconds=12.0,
        phone_size_px=(320, 240),
        voxel_m=0.05,
        mesh_faces=3000,
        texel_m=0.02,
        glasses_seconds=0.5,
        glasses_size_px=(272, 270),
        model_stride=0,
        exact_room=True,
    ),
    "table2-a-plain": _SETTING_A,
    "table2-a-hard": _hard(_SETTING_A, (0, 1, 2, 3, 4)),
    "table2-b-plain": _SETTING_B,
    "table2-b-hard": _hard(_SETTING_B, (10, 11, 12, 13, 15)),
}
"""`studio` is the sample scene; the scenes of Table II have two settings of markers, each plain and hard."""


def scene_room(options: SceneOptions, report: Report = silent) -> Room:
    """The exact room of a scene."""
    return build_room(
        options.tag_ids,
        options.tag_size_m,
        options.bare,
        options.light_spacing_m,
        options.light_rays,
        options.texel_scale,
        options.seed,
        report,
    )


def write_scene(folder: Path, options: SceneOptions = SceneOptions(), report: Report = silent) -> None:
    """Write a whole scene into `folder`, which is made if it is missing; files of the same names are replaced."""
    room = scene_room(options, part(report, 0.0, 0.04))
    for name in ("scan", "truth", *(recording_name(route) for route in options.routes)):
        (folder / name).mkdir(parents=True, exist_ok=True)
    capture = _write_scan(folder / "scan", room, options, part(report, 0.04, 0.2))
    truth.write_phone(folder / "truth" / "phone.tum", capture.seconds.tolist(), capture.true)
    truth.write_tags(folder / "truth", room.tags, options.tag_size_m)
    step = 0.65 / len(options.routes)
    for number, route in enumerate(options.routes):
        share = part(report, 0.2 + number * step, 0.2 + (number + 1) * step)
        _write_recording(folder, room, route, options, share)
    if options.exact_room:
        truth.write_room(folder / "truth" / "room.ply", room.mesh)
    if options.model_stride:
        write_model(
            folder / "recording", folder / "colmap", options.model_stride, options.seed, part(report, 0.86, 1.0)
        )
    _write_description(folder, options)
    report(1.0, "done")


def recording_name(route: RouteName) -> str:
    """The folder of a route's recording within the scene."""
    return "recording" + _suffix(route)


def truth_name(route: RouteName) -> str:
    """The file of a route's true poses within the scene."""
    return f"truth/glasses{_suffix(route)}.tum"


def _suffix(route: RouteName) -> str:
    return "" if route == "first" else f"-{route}"


def glasses_capture(route: RouteName, options: SceneOptions) -> GlassesCapture:
    """A route's recording before anything is drawn: its lens, times and exact path."""
    seed, hurry = _seed(route, options), _hurry(route, options)
    times = glasses.frame_times(min(options.glasses_seconds, WALK_SECONDS / hurry), options.glasses_hz, seed + 30)
    path = paths.head_path(seed + 40, route, hurry)
    lens = glasses.lens(options.glasses_size_px)
    return GlassesCapture(lens, times, path, SCAN_FROM_ROOM, options.glasses_exposure_s)


def _hurry(route: RouteName, options: SceneOptions) -> float:
    return options.hurry[min(tuple(ROUTES).index(route), len(options.hurry) - 1)]


def _seed(route: RouteName, options: SceneOptions) -> int:
    return options.seed + (0 if route == "first" else 1000)


def _write_scan(folder: Path, room: Room, options: SceneOptions, report: Report) -> phone.PhoneCapture:
    seconds = np.linspace(0, options.phone_seconds, options.phone_frames)
    true = SCAN_FROM_ROOM * paths.phone_path(options.phone_seconds, options.seed + 10).poses(seconds)
    wandering = paths.drift(seconds, options.drift_m, options.drift_deg, options.seed + 20)
    capture = phone.plan(seconds, true, wandering, options.phone_size_px)
    phone.write(folder, room, capture, options.phone_quality, options.seed, part(report, 0.0, 0.9))
    mesh = textured(folder, fused(folder, capture, options.voxel_m, options.mesh_faces), capture, options.texel_m, 4096)
    write_obj(folder, mesh, 82)
    phone.write_info(folder, capture, len(mesh.faces), len(mesh.vertices))
    report(1.0, "mesh written")
    return capture


def _write_recording(scene: Path, room: Room, route: RouteName, options: SceneOptions, report: Report) -> None:
    capture, seed = glasses_capture(route, options), _seed(route, options)
    folder = scene / recording_name(route)
    gaze = looked(room, capture, seed + 50)
    glasses.write_camera(folder, capture)
    cloud.write_tables(folder, capture, gaze, seed)
    truth.write_gaze(scene / "truth" / f"gaze3d{_suffix(route)}.csv", gaze)
    truth.write_glasses(scene / truth_name(route), capture.timestamp_ns, capture.poses_at(capture.timestamp_ns))
    video = folder / cloud.video_name(capture, seed)
    glasses.write_video(video, room, capture, options.glasses_gain, options.video_crf, seed, report)


def read_options(scene: Path) -> SceneOptions:
    """The options that a scene folder was written with.

    Raises:
        InputError: if its `scene.json` is missing or is not JSON.
    """
    value: dict[str, Any] = read_json(scene / "scene.json", "the description of a scene")["options"]
    named: Any = {k: tuple(v) if isinstance(v, list) else v for k, v in value.items()}
    return SceneOptions(**named)


def _write_description(folder: Path, options: SceneOptions) -> None:
    plain = asdict(SceneOptions())
    description = {
        "scan": "scan",
        "recording": "recording",
        "colmap": "colmap" if options.model_stride else None,
        "truth": "truth/glasses.tum",
        "tag_family": FAMILY,
        "tag_size_m": options.tag_size_m,
        "options": {k: v for k, v in asdict(options).items() if k not in _LATER or v != plain[k]},
    }
    if len(options.routes) > 1:
        description["recordings"] = {route: [recording_name(route), truth_name(route)] for route in options.routes}
    text = json.dumps(description, indent=2) + "\n"
    (folder / "scene.json").write_text(text)
    (folder / "truth" / "scene.json").write_text(text)


def _print_report(fraction: float, text: str = "", /) -> None:
    sys.stderr.write(f"\r{100 * fraction:5.1f} %  {text:<40}")
    sys.stderr.flush()


def main(folder: Path, /, preset: str = "studio") -> None:
    """Write the scene of a preset (studio, tiny, table2-a-plain, ...) into FOLDER."""
    if preset not in PRESETS:
        sys.exit(f"There is no preset {preset!r}; use one of {', '.join(PRESETS)}.")
    write_scene(folder, PRESETS[preset], _print_report)
    sys.stderr.write("\n")


if __name__ == "__main__":
    tyro.cli(main)
