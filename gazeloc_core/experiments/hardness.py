"""How hard a made-up recording is: its light, its blur, its turns, and what plain COLMAP makes of it.

    python -m gazeloc_core.experiments.hardness SCENE

prints the facts of every recording of a scene, and with `--colmap` the share of keyframes in COLMAP's largest model.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pycolmap
import tyro

from gazeloc_core.arrays import Bytes, Floats, Ints
from gazeloc_core.camera import Camera
from gazeloc_core.frames.undistort import Undistorter
from gazeloc_core.readers import open_recording, open_scan
from gazeloc_core.recording import Recording
from gazeloc_core.sfm.keyframes import choose_keyframes, measure_frames
from gazeloc_core.surfaces.raycast import Raycaster
from gazeloc_core.synthesis.glasses import GlassesCapture, motion_grid, moved_px
from gazeloc_core.synthesis.routes import RouteName
from gazeloc_core.synthetic import SceneOptions, glasses_capture, read_options, recording_name

HARD_GREY, HARD_BLUR_PX, HARD_COLMAP = 60.0, 6.0, 0.6
"""A hard scene is no brighter, no less blurred, and COLMAP's largest model holds no larger share than these."""
FAR_M = 3.0
"""The depth of pixels behind which the scan has a hole."""


@dataclass(frozen=True)
class Hardness:
    """Over the frames: mean grey level (0 to 255), 90th percentiles of the exact blur and of the head's turns."""

    mean_grey: float
    blur_p90_px: float
    turn_p90_deg_per_s: float


def hardness(scene: Path, options: SceneOptions, route: RouteName) -> Hardness:
    """The hardness of a route's recording in a scene folder."""
    capture = glasses_capture(route, options)
    recording = open_recording(scene / recording_name(route))
    blur = blur_px(capture, Raycaster(open_scan(scene / "scan").mesh))
    return Hardness(
        mean_grey=float(np.mean([_grey(rgb).mean() for _, rgb in recording.frames.iterate(range(len(recording)))])),
        blur_p90_px=float(np.percentile(blur, 90)),
        turn_p90_deg_per_s=float(np.percentile(turn_deg_per_s(capture), 90)),
    )


def blur_px(capture: GlassesCapture, caster: Raycaster) -> Floats:
    """(N,) the median over each frame of how far its pixels move while the shutter is open, by the exact path."""
    pixels = motion_grid(capture.camera)
    rays = capture.camera.unproject(pixels)
    half = int(capture.exposure_s * 1e9) // 2
    blur = np.zeros(len(capture.timestamp_ns))
    for index, time in enumerate(capture.timestamp_ns.tolist()):
        poses = capture.poses_at(np.array([time - half, time, time + half]))
        hits = caster.cast(poses[1].translation, rays @ poses[1].rotation.as_matrix().T)
        depth = np.where(hits.is_hit, hits.distance * rays[:, 2], FAR_M)
        blur[index] = np.median(np.linalg.norm(moved_px(capture.camera, pixels, depth, poses), axis=1))
    return blur


def turn_deg_per_s(capture: GlassesCapture) -> Floats:
    """(N,) how fast the head turns at each frame."""
    step_ns = 5_000_000
    before, after = (capture.poses_at(capture.timestamp_ns + side * step_ns) for side in (-1, 1))
    return np.asarray(np.degrees((before.rotation.inv() * after.rotation).magnitude()) / (2 * step_ns / 1e9))


def plain_colmap_share(images: Path, names: list[str], camera: Camera, seeds: tuple[int, ...] = (1, 2, 3)) -> float:
    """The share of pictures in the largest model of COLMAP as it comes: defaults, all pairs, known calibration.

    The median over `seeds` of the mapping: where models break apart hangs on the pair it starts with.
    """
    with tempfile.TemporaryDirectory() as temporary:
        database, output = Path(temporary) / "database.db", Path(temporary) / "models"
        output.mkdir()
        pycolmap.logging.minloglevel = pycolmap.logging.FATAL.value
        reader = pycolmap.ImageReaderOptions()
        reader.camera_model = camera.model
        reader.camera_params = ",".join(repr(value) for value in camera.params.tolist())
        pycolmap.extract_features(
            database, images, names, camera_mode=pycolmap.CameraMode.SINGLE, reader_options=reader
        )
        pycolmap.match_exhaustive(database)
        largest = [_largest_model(database, images, output / str(seed), seed) for seed in seeds]
    return float(np.median(largest)) / len(names)


def _largest_model(database: Path, images: Path, output: Path, seed: int) -> int:
    output.mkdir()
    mapping = pycolmap.IncrementalPipelineOptions()
    mapping.random_seed = seed
    models = pycolmap.incremental_mapping(database, images, output, mapping)
    return max((model.num_reg_images() for model in models.values()), default=0)


def _undistorted_keyframes(recording: Recording, folder: Path) -> tuple[list[str], Camera]:
    keyframes: Ints = choose_keyframes(recording.timestamp_ns, measure_frames(recording))
    undistorter = Undistorter.of(recording.camera)
    names = []
    for index, rgb in recording.frames.iterate(keyframes.tolist()):
        names.append(f"frame_{index:06d}.jpg")
        bgr = cv2.cvtColor(undistorter.image(rgb), cv2.COLOR_RGB2BGR)
        cv2.imwrite(str(folder / names[-1]), bgr, [cv2.IMWRITE_JPEG_QUALITY, 95])
    return names, undistorter.target


def _grey(rgb: Bytes) -> Bytes:
    return np.asarray(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY))


def main(scene: Path, /, colmap: bool = False) -> None:
    """Print how hard the recordings of SCENE are."""
    options = read_options(scene)
    for route in options.routes:
        facts = hardness(scene, options, route)
        text = (
            f"{scene.name} {route}: mean grey {facts.mean_grey:.0f}, blur {facts.blur_p90_px:.1f} px and turns "
            f"{facts.turn_p90_deg_per_s:.0f} deg/s (90th percentile)"
        )
        if colmap:
            with tempfile.TemporaryDirectory() as temporary:
                names, camera = _undistorted_keyframes(open_recording(scene / recording_name(route)), Path(temporary))
                share = plain_colmap_share(Path(temporary), names, camera)
            text += f", largest model of plain COLMAP {share:.0%} of {len(names)} keyframes"
        print(text)


if __name__ == "__main__":
    tyro.cli(main)
