"""Structure from motion: the choice of pairs, refusals, cancelling, and real rooms."""

import time
from pathlib import Path

import cv2
import numpy as np
import pytest
from corner_room import CAMERA, write_room
from data import SHARED, needs_shared

from gazeloc_core.camera import Camera
from gazeloc_core.errors import Cancelled, InputError, ReconstructionError
from gazeloc_core.readers import open_scan
from gazeloc_core.sfm.pairs import choose_pairs, frame_signatures, pairs_alike, pairs_near_in_time
from gazeloc_core.sfm.reconstruction import SfmOptions, reconstruct


def test_pairs_near_in_time() -> None:
    pairs = pairs_near_in_time(40, 3)
    assert {(0, 1), (0, 3), (36, 39), (0, 4), (0, 32)} <= pairs
    assert not {(0, 5), (0, 31), (39, 40)} & pairs
    assert all(a < b < 40 for a, b in pairs)


def test_frames_that_look_alike_are_paired_across_time() -> None:
    rng = np.random.default_rng(1)
    places = [rng.integers(0, 120, (300, 128)).astype(np.uint8) for _ in range(5)]
    frames = [np.clip(p + rng.integers(0, 9, p.shape), 0, 255).astype(np.uint8) for _ in range(2) for p in places]
    signatures = frame_signatures(frames, seed=0)
    np.testing.assert_allclose(np.linalg.norm(signatures, axis=1), 1)
    assert pairs_alike(signatures, 1, known=set()) == {(i, i + 5) for i in range(5)}
    assert (0, 5) not in pairs_alike(signatures, 1, known={(0, 5)})


def test_few_frames_are_matched_in_all_pairs_and_frames_without_features_do_no_harm() -> None:
    empty = [np.empty((0, 128), np.uint8)] * 5
    assert len(choose_pairs(empty, 1, SfmOptions())) == 10
    assert np.isfinite(frame_signatures(empty, seed=0)).all()
    assert len(choose_pairs(empty, 1, SfmOptions(exhaustive_up_to=2, sequential_neighbours=1))) >= 4


def test_a_small_room_comes_out_the_same_twice(tmp_path: Path) -> None:
    names = write_room(tmp_path)
    frames = np.arange(len(names)) * 10 + 3
    first, again = (reconstruct(tmp_path, names, CAMERA, frames, tmp_path / "work") for _ in range(2))
    assert len(first[0]) == len(names)
    assert first[0].frame_indices.tolist() == frames.tolist()
    assert first[0].image_names == tuple(names)
    np.testing.assert_array_equal(first[0].cameras[1].params, CAMERA.params)  # intrinsics stay as given
    assert np.median(first[0].point_errors_px) < 1
    baselines = [np.linalg.norm(np.diff(m.sfm_from_camera.translation, axis=0), axis=1) for m in (first[0], again[0])]
    shapes = [b / b.sum() for b in baselines]
    np.testing.assert_allclose(shapes[0], shapes[1], atol=1e-3)


def test_observations_stay_with_their_images(tmp_path: Path) -> None:
    names = write_room(tmp_path)
    model = reconstruct(tmp_path, names, CAMERA, np.arange(len(names)), tmp_path / "work")[0]
    poses = model.sfm_from_camera.inv().as_matrix()[model.observation_image]
    points = model.points[model.observation_point]
    pixels = CAMERA.project(np.einsum("nij,nj->ni", poses[:, :3, :3], points) + poses[:, :3, 3])
    assert np.median(np.linalg.norm(pixels - model.observation_px, axis=1)) < 1


def test_cancelling_stops_it_and_passes_through(tmp_path: Path) -> None:
    names = write_room(tmp_path)
    asked = []

    def report(fraction: float, text: str = "", /) -> None:
        asked.append(fraction)
        if fraction > 0.3:
            raise Cancelled("stop")

    with pytest.raises(Cancelled):
        reconstruct(tmp_path, names, CAMERA, np.arange(len(names)), tmp_path / "work", report=report)
    assert not list((tmp_path / "work").rglob("images.bin"))


def test_progress_never_runs_backwards(tmp_path: Path) -> None:
    names = write_room(tmp_path)
    fractions: list[float] = []
    reconstruct(tmp_path, names, CAMERA, np.arange(8), tmp_path / "work", report=lambda f, t="", /: fractions.append(f))
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1


def test_pictures_without_texture_say_what_was_tried(tmp_path: Path) -> None:
    names = [f"{i}.png" for i in range(4)]
    for name in names:
        cv2.imwrite(str(tmp_path / name), np.full((240, 320), 90, np.uint8))
    with pytest.raises(ReconstructionError, match=r"4 frames \(median of 0 features per frame, 6 pairs matched"):
        reconstruct(tmp_path, names, CAMERA, np.arange(4), tmp_path / "work")


def test_missing_or_too_few_pictures_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="at least 3 pictures, got 2"):
        reconstruct(tmp_path, ["a.png", "b.png"], CAMERA, np.arange(2), tmp_path / "work")
    with pytest.raises(InputError, match=r"a\.png: the picture is missing"):
        reconstruct(tmp_path, ["a.png", "b.png", "c.png"], CAMERA, np.arange(3), tmp_path / "work")


@pytest.mark.slow
@needs_shared
def test_the_bedroom_registers_whole(tmp_path: Path) -> None:
    images = SHARED / "swatbotics_room_B" / "images"
    names = sorted(path.name for path in images.iterdir())
    camera = Camera.from_opencv(816, 612, [[765.00, 0, 393.72], [0, 764.18, 304.66], [0, 0, 1]], [])
    start = time.perf_counter()
    models = reconstruct(images, names, camera, np.arange(len(names)), tmp_path)
    print(f"{len(models[0])} of {len(names)} in {time.perf_counter() - start:.0f} s")
    assert len(models[0]) == 31


@pytest.mark.slow
@needs_shared
def test_the_chair_agrees_with_the_phones_own_poses(tmp_path: Path) -> None:
    frames = open_scan(SHARED / "3dscannerapp_chair" / "chair_scan").frames_with_images
    names = [f"{i:03d}.jpg" for i in range(len(frames))]
    (tmp_path / "images").mkdir()
    for frame, name in zip(frames, names, strict=True):
        small = cv2.resize(frame.read_image(), (960, 720), interpolation=cv2.INTER_AREA)
        cv2.imwrite(str(tmp_path / "images" / name), small[..., ::-1])
    params = np.mean([frame.camera.scaled(960, 720).params for frame in frames], axis=0)
    camera = Camera(frames[0].camera.model, 960, 720, params)
    models = reconstruct(tmp_path / "images", names, camera, np.arange(len(names)), tmp_path / "work")
    truth = np.array([frames[i].scan_from_camera.translation for i in models[0].frame_indices])
    errors = residuals_after_similarity(models[0].sfm_from_camera.translation, truth)
    print(f"{len(models[0])} of {len(names)}, mean {errors.mean() * 1000:.1f} mm")
    assert len(models[0]) == len(names)
    assert errors.mean() < 0.008


def residuals_after_similarity(points: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Distances (N,) after the best similarity (Umeyama 1991, eqs. 34 to 43), written apart from the product's own."""
    a, b = points - points.mean(axis=0), truth - truth.mean(axis=0)
    u, d, vt = np.linalg.svd(b.T @ a / len(a))
    sign = np.diag([1, 1, np.sign(np.linalg.det(u @ vt))])
    scale = np.trace(np.diag(d) @ sign) / a.var(axis=0).sum()
    return np.linalg.norm(scale * a @ (u @ sign @ vt).T - b, axis=1)
