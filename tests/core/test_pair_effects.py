"""What a pair does is what a fit without it says, pair by pair."""

from __future__ import annotations

import numpy as np
from box_room import make_room

from gazeloc_core.alignment.correspondences import Correspondences
from gazeloc_core.alignment.pair_effects import pair_effects
from gazeloc_core.alignment.similarity_fit import fit_similarity


def noisy_pairs(room, count, seed=0, noise_m=0.02):
    rng = np.random.default_rng(seed)
    rows = rng.choice(len(room.model.points), count, replace=False)
    in_scan = room.scan_from_sfm.apply(room.model.points[rows]) + rng.normal(0, noise_m, (count, 3))
    names = tuple(f"k{i}" for i in range(count))
    return Correspondences(names, names, room.model.points[rows], in_scan, rng.uniform(0.01, 0.04, count))


def test_each_effect_is_that_of_a_fit_to_the_others():
    room = make_room(points=200, images=12)
    pairs, centres = noisy_pairs(room, 7), room.model.sfm_from_camera.translation
    inlier = np.array([True] * 6 + [False])
    kept = pairs.take(inlier)
    fit = fit_similarity(kept.sfm, kept.scan, kept.weights)
    effects = pair_effects(fit, pairs, inlier, room.model)
    for row in range(6):
        rest = pairs.take(inlier & (np.arange(7) != row))
        without = fit_similarity(rest.sfm, rest.scan, rest.weights)
        expected = np.linalg.norm(without.apply(pairs.sfm[row]) - pairs.scan[row])
        np.testing.assert_allclose(effects.left_out_m[row], expected, rtol=1e-9)
        moved = np.linalg.norm(without.apply(centres) - fit.apply(centres), axis=1).mean()
        np.testing.assert_allclose(effects.cameras_move_m[row], moved, rtol=1e-9)
    assert effects.cameras_move_m[6] == 0  # it takes no part
    assert effects.left_out_m[6] > 0


def test_where_the_others_determine_nothing_there_is_no_effect():
    room = make_room(points=50, images=5)
    pairs = noisy_pairs(room, 3)
    fit = fit_similarity(pairs.sfm, pairs.scan, pairs.weights)
    effects = pair_effects(fit, pairs, np.ones(3, bool), room.model)
    assert np.isnan(effects.left_out_m).all()
    assert np.isnan(effects.cameras_move_m).all()
    assert np.isnan(pair_effects(fit, noisy_pairs(room, 5), np.ones(5, bool), None).cameras_move_m).all()
