"""Tags and drifting phone poses adjusted together, against tags whose places are known."""

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from gazeloc_core.camera import Camera
from gazeloc_core.tags.bundle import TagBundleOptions as Options
from gazeloc_core.tags.bundle import TagScene, _Problem, adjust_tags
from gazeloc_core.tags.square import UNIT_SQUARE, fit_square

CAMERA = Camera.pinhole(960, 720, 720, 720, 480, 360)
SIZE_M = 0.16
FRAMES = 40


def tags() -> np.ndarray:
    """Six tags (6, 4, 3) around a room of 4 m, facing its middle."""
    square = np.column_stack([UNIT_SQUARE * SIZE_M, np.zeros(4)])
    around = [Rotation.from_euler("y", 60 * i, degrees=True).as_matrix() for i in range(6)]
    return np.array([(square + np.array([0.1 * i, 0.05 * i, 2.0])) @ turn.T for i, turn in enumerate(around)])


def truth() -> RigidTransform:
    """A phone that turns once around in the middle of the room."""
    angle = np.linspace(0, 2 * np.pi, FRAMES)
    centres = np.column_stack([0.3 * np.sin(angle), 0.1 * np.cos(2 * angle), 0.3 * np.cos(angle)])
    return RigidTransform.from_components(centres, Rotation.from_rotvec(np.outer(angle, [0, 1, 0])))


def slow_drift(seed: int) -> tuple[np.ndarray, Rotation]:
    """Shifts (F, 3) of 1 cm and turns of 0.2°, slow and of mean zero."""
    rng = np.random.default_rng(seed)
    phase = np.linspace(0, 2 * np.pi, FRAMES, endpoint=False)[:, None] * [1, 2, 3]
    waves = [(np.sin(phase + rng.uniform(0, 6.3, 3)) * rng.normal(size=3)) @ rng.normal(size=(3, 3)) for _ in range(2)]
    shift, turn = (wave / np.sqrt((wave**2).sum(axis=1).mean()) for wave in waves)
    return 0.01 * shift, Rotation.from_rotvec(np.radians(0.2) * turn)


def scene(shift: np.ndarray, turn: Rotation, edge_px: float = 0.0, noise_px: float = 0.0) -> TagScene:
    """What a phone with this drift reports; the first thought is the mean of each tag's places."""
    true, squares = truth(), tags()
    reported = RigidTransform.from_components(true.translation + shift, turn * true.rotation)
    rng = np.random.default_rng(9)
    frame, tag, pixels, places = [], [], [], []
    for f in range(FRAMES):
        for t, square in enumerate(squares):
            local = true[f].inv().apply(square)
            seen = CAMERA.project(local)
            if (local[:, 2] > 0.2).all() and CAMERA.contains(seen).all():
                outward = seen - seen.mean(axis=0)
                outward *= np.sqrt(2) / np.linalg.norm(outward, axis=1, keepdims=True)
                frame.append(f)
                tag.append(t)
                pixels.append(seen - edge_px * outward + rng.normal(0, noise_px, (4, 2)))
                places.append(reported[f].apply(local))
    on_mesh, which = np.array(places), np.array(tag)
    start = np.array([fit_square(on_mesh[which == t].mean(axis=0), SIZE_M) for t in range(len(squares))])
    seconds = 0.7 * np.arange(FRAMES)
    intrinsics = np.tile([720.0, 720, 480, 360], (len(frame), 1))
    return TagScene(reported, seconds, np.array(frame), which, np.array(pixels), intrinsics, on_mesh, start)


def rms(corners: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.sum((corners - tags()) ** 2, axis=2))))


def test_without_drift_nothing_moves() -> None:
    still = scene(np.zeros((FRAMES, 3)), Rotation.identity(FRAMES))
    assert rms(adjust_tags(still, SIZE_M)) < 1e-4


def test_slow_drift_leaves_less_in_the_tags_than_averaging_does() -> None:
    before, after = [], []
    for seed in range(6):
        drifting = scene(*slow_drift(seed), noise_px=0.2)
        before.append(rms(drifting.corners))
        after.append(rms(adjust_tags(drifting, SIZE_M)))
    assert (np.array(after) < np.array(before)).all()


def test_tags_that_look_too_small_are_not_taken_for_far_ones() -> None:
    shrunk = scene(np.zeros((FRAMES, 3)), Rotation.identity(FRAMES), edge_px=0.3)
    assert rms(adjust_tags(shrunk, SIZE_M)) < 0.001
    stubborn = adjust_tags(shrunk, SIZE_M, Options(edge_shift_error_px=1e-3))  # what it would be without the unknown
    assert rms(stubborn) > 0.002


def test_one_false_sighting_does_no_harm() -> None:
    still = scene(np.zeros((FRAMES, 3)), Rotation.identity(FRAMES))
    still.pixels[5] += 40
    assert rms(adjust_tags(still, SIZE_M)) < 0.003


def test_tags_keep_their_size() -> None:
    adjusted = adjust_tags(scene(*slow_drift(1)), SIZE_M)
    np.testing.assert_allclose(np.linalg.norm(adjusted - np.roll(adjusted, 1, axis=1), axis=2), SIZE_M)


def test_the_declared_sparsity_holds_every_dependence() -> None:
    problem = _Problem(scene(*slow_drift(2)), SIZE_M, Options())
    declared = problem.sparsity().toarray() > 0
    rng = np.random.default_rng(0)
    at = rng.normal(0, 1e-3, problem.unknowns)
    base = problem.residuals(at)
    for unknown in range(problem.unknowns):
        moved = at.copy()
        moved[unknown] += 1e-3
        changed = np.abs(problem.residuals(moved) - base) > 1e-9
        assert not (changed & ~declared[:, unknown]).any()
