"""What suggested places are worth: a scripted user who clicks until the cameras are known to 1 cm and 0.2 degrees.

The room of the tests: 4000 points of a reconstruction with 1 cm of noise, 40 cameras. Both users click among the same
400 points, drawn anew for each seed, and are off by 1 cm (normal, per axis) on each side. After every pair from the
third on the pairs are aligned as in the app, and both stop at the first alignment whose mean error over the cameras,
against the truth, is within 1 cm and 0.2 degrees, or after 60 pairs.

With: each place is the one that `next_keypoint.suggest` names, from the first on; before the third pair under a guessed
placement that is turned by some 10 degrees and shifted by half a metre, as the app guesses one. Without: each place is
drawn evenly from the 400. A second row compares with a careful person without suggestions, who always takes the one of
ten random places that lies farthest from all clicked ones (no target, for orientation).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from box_room import Room, make_room, perturbed, pose_errors_of

from gazeloc_core.alignment.alignment import align
from gazeloc_core.alignment.correspondences import Correspondences
from gazeloc_core.alignment.next_keypoint import SuggestionOptions, suggest
from gazeloc_core.arrays import Floats
from gazeloc_core.errors import GeometryError
from gazeloc_core.transforms import Similarity

Row = tuple[str, str, bool]
Choose = Callable[[Similarity, Correspondences, Floats, list[int]], int]
NOISE_M = 0.01
MOST = 60
OFFERED = 400


def bench_suggestions(seeds: int = 50) -> list[Row]:
    """The median number of pairs with and without suggestions."""
    room = make_room(point_noise_m=NOISE_M, mesh_noise_m=0.005)
    counts = {"with": [], "without": [], "careful": []}  # type: ignore[var-annotated]
    for seed in range(seeds):
        counts["with"].append(_pairs_needed(room, seed, lambda *now: _suggested(room, *now)))
        rng = np.random.default_rng(1000 + seed)
        counts["without"].append(_pairs_needed(room, seed, lambda *now, rng=rng: _any(rng, *now)))
        counts["careful"].append(_pairs_needed(room, seed, lambda *now, rng=rng: _far(rng, *now)))
    median = {name: float(np.median(values)) for name, values in counts.items()}
    mean = {name: float(np.mean(values)) for name, values in counts.items()}
    fewer, than_careful = (1 - median["with"] / median[name] for name in ("without", "careful"))
    text = f"median {median['with']:g} against {median['without']:g} (mean {mean['with']:.1f}, {mean['without']:.1f})"
    careful = f"{than_careful:.0%} fewer: {median['with']:g} against {median['careful']:g} (mean {mean['careful']:.1f})"
    return [
        (f"pairs until 1 cm and 0.2°, {seeds} seeds: >= 20 % fewer with", f"{fewer:.0%} fewer: {text}", fewer >= 0.2),
        ("the same against a careful person without suggestions (no target)", careful, True),
    ]


def _pairs_needed(room: Room, seed: int, choose: Choose) -> int:
    """How many pairs a user clicks who chooses like this; the room's 400 places and the guess are the seed's."""
    rng = np.random.default_rng(seed)
    offered = rng.choice(len(room.model.points), OFFERED, replace=False)
    in_sfm, scale = room.model.points[offered], room.scan_from_sfm.scale
    true_in_scan = room.scan_from_sfm.apply(in_sfm)
    scan = true_in_scan + rng.normal(0, NOISE_M, in_sfm.shape)  # a place is clicked once: its error is the same for all
    sfm = in_sfm + rng.normal(0, NOISE_M / scale, in_sfm.shape)
    current = perturbed(room.scan_from_sfm, 0.5, 10.0, seed)
    clicked: list[int] = []
    while len(clicked) < MOST:
        clicked.append(choose(current, _pairs(sfm, scan, clicked), in_sfm, clicked))
        if len(clicked) < 3:
            continue
        try:
            current = align(_pairs(sfm, scan, clicked), model=room.model).scan_from_sfm
        except GeometryError:
            continue
        position_m, rotation_deg = pose_errors_of(room, current)
        if position_m <= 0.01 and rotation_deg <= 0.2:
            break
    return len(clicked)


def _pairs(sfm: Floats, scan: Floats, rows: list[int]) -> Correspondences:
    names = tuple(f"k{row}" for row in rows)
    return Correspondences(names, names, sfm[rows], scan[rows], np.full(len(rows), np.sqrt(2) * NOISE_M))


def _suggested(room: Room, current: Similarity, pairs: Correspondences, in_sfm: Floats, clicked: list[int]) -> int:
    rest = np.setdiff1d(np.arange(len(in_sfm)), clicked)
    cameras = current.apply(room.model.sfm_from_camera.translation)
    options = SuggestionOptions(click_sigma_m=float(np.sqrt(2) * NOISE_M))
    found = suggest(current, pairs, current.apply(in_sfm[rest]), cameras, options)
    assert found is not None
    return int(rest[found.candidate])


def _any(
    rng: np.random.Generator, current: Similarity, pairs: Correspondences, in_sfm: Floats, clicked: list[int]
) -> int:
    del current, pairs
    return int(rng.choice(np.setdiff1d(np.arange(len(in_sfm)), clicked)))


def _far(
    rng: np.random.Generator, current: Similarity, pairs: Correspondences, in_sfm: Floats, clicked: list[int]
) -> int:
    del current, pairs
    ten = rng.choice(np.setdiff1d(np.arange(len(in_sfm)), clicked), 10, replace=False)
    if not clicked:
        return int(ten[0])
    apart = np.linalg.norm(in_sfm[ten][:, None] - in_sfm[clicked], axis=2).min(axis=1)
    return int(ten[apart.argmax()])
