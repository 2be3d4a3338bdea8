"""Whether the agreement score ranks frames with wrong poses below those with the true ones, on the sample scene.

The truth is the recording's; every frame is scored at its true pose and at poses shifted or turned in a random
direction by a fixed size. AUC (area under the ROC curve) is over all frames; "of the same frame" is the share of
frames whose own shifted pose scores below its true one.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from gazeloc_core.agreement import FrameScorer
from gazeloc_core.arrays import Floats
from gazeloc_core.evaluate import match_times
from gazeloc_core.readers import open_recording, open_scan
from gazeloc_core.truth import read_tum

Row = tuple[str, str, bool]
FRAMES = 40
SHIFTS_M = (0.01, 0.02, 0.03, 0.05, 0.10)
TURNS_DEG = (0.5, 1.0, 2.0, 5.0)


def bench_agreement(scene: Path) -> list[Row]:
    """The AUC of each size of error, and of all errors of 2 cm or 1° and more together."""
    recording, scan = open_recording(scene / "recording"), open_scan(scene / "scan")
    times, poses = read_tum(scene / "truth" / "glasses.tum")
    rows = match_times(recording.timestamp_ns, times)
    known = np.flatnonzero(rows >= 0)
    frames = known[np.linspace(0, len(known) - 1, FRAMES).astype(int)].tolist()
    scorer, rng = FrameScorer(scan.mesh, recording.camera), np.random.default_rng(0)
    true: list[float] = []
    wrong: dict[str, list[float]] = {_name(cm, deg): [] for cm, deg in _errors()}
    for index, rgb in recording.frames.iterate(frames):
        pose = poses[int(rows[index])]
        true.append(scorer.score(rgb, pose).score)
        for shift_m, turn_deg in _errors():
            wrong[_name(shift_m, turn_deg)].append(scorer.score(rgb, pose * _error(rng, shift_m, turn_deg)).score)
    return _rows(np.array(true), {name: np.array(values) for name, values in wrong.items()})


def _errors() -> list[tuple[float, float]]:
    return [*((shift, 0.0) for shift in SHIFTS_M), *((0.0, turn) for turn in TURNS_DEG)]


def _name(shift_m: float, turn_deg: float) -> str:
    return f"shifted by {100 * shift_m:.0f} cm" if shift_m else f"turned by {turn_deg:g}°"


def _error(rng: np.random.Generator, shift_m: float, turn_deg: float) -> RigidTransform:
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    turn = Rotation.from_rotvec(np.radians(turn_deg) * direction)
    return RigidTransform.from_components(shift_m * direction, turn)


def _rows(true: Floats, wrong: dict[str, Floats]) -> list[Row]:
    counted = [name for name, (m, deg) in zip(wrong, _errors(), strict=True) if m >= 0.02 or deg >= 1]
    together = _auc(true, np.concatenate([wrong[name] for name in counted]))
    what = "score: all errors of 2 cm or 1° and more (the sizes below, as many of each): AUC >= 0.95"
    rows = [(what, f"{together:.3f}", together >= 0.95)]
    for name, values in wrong.items():
        auc, same = _auc(true, values), float(np.mean(values < true))
        is_counted = name in counted
        text = f"{auc:.3f}; of the same frame {same:.2f}"
        rows.append((f"score: {name}: AUC{' >= 0.95' if is_counted else ''}", text, auc >= 0.95 or not is_counted))
    return rows


def _auc(true: Floats, wrong: Floats) -> float:
    """The chance that a wrong pose scores below a true one; one without a score counts as lowest."""
    true, wrong = np.nan_to_num(true, nan=-1.0), np.nan_to_num(wrong, nan=-1.0)
    below, equal = wrong[:, None] < true[None], wrong[:, None] == true[None]
    return float(np.mean(below + 0.5 * equal))
