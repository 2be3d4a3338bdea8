"""Suggestions: what they promise is what the propagation of errors says once the pair is there."""

from __future__ import annotations

import numpy as np
import pytest

from gazeloc_core.alignment.correspondences import Correspondences
from gazeloc_core.alignment.evidence import fit_covariance
from gazeloc_core.alignment.next_keypoint import SuggestionOptions, suggest
from gazeloc_core.alignment.similarity_fit import similarity_jacobian
from gazeloc_core.transforms import Similarity

HERE = Similarity.identity()
SIGMA_M = 0.02
OPTIONS = SuggestionOptions(click_sigma_m=SIGMA_M, prior_rotation_deg=1e6, prior_position_m=1e6, prior_scale=1e6)


def pairs_at(places):
    places = np.reshape(places, (-1, 3))
    names = tuple(f"k{i}" for i in range(len(places)))
    return Correspondences(names, names, places, places, np.full(len(places), SIGMA_M))


def spread_m(places, cameras, centre):
    covariance = fit_covariance(np.reshape(places, (-1, 3)), pairs_at(places), centre)
    jacobian = similarity_jacobian(cameras, centre)
    rotation_deg = np.rad2deg(np.sqrt(np.trace(covariance[:3, :3])))
    return np.sqrt(np.einsum("nia,ab,nib->n", jacobian, covariance, jacobian).mean()), rotation_deg


def test_the_promised_uncertainties_are_those_of_the_fit_with_the_pair_and_no_candidate_is_better():
    rng = np.random.default_rng(5)
    places, candidates, cameras = rng.normal(0, 2, (5, 3)), rng.normal(0, 2, (60, 3)), rng.normal(0, 1, (20, 3))
    centre = places.mean(axis=0)
    found = suggest(HERE, pairs_at(places), candidates, cameras, OPTIONS)
    assert (found.cameras_before_m, found.rotation_before_deg) == pytest.approx(spread_m(places, cameras, centre))
    after = [spread_m([*places, place], cameras, centre) for place in candidates]
    assert (found.cameras_after_m, found.rotation_after_deg) == pytest.approx(after[found.candidate])
    goal = [(position / 0.01) ** 2 + (rotation / 0.2) ** 2 for position, rotation in after]
    assert found.candidate == int(np.argmin(goal))


def test_pairs_on_a_line_leave_the_turn_about_it_and_a_place_beside_it_is_suggested():
    on_line = [[x, 0, 0.001 * x * x] for x in (-2.0, -1.0, 0.5, 2.0)]
    cameras = np.array([[0.0, 1.5, 0.2], [0.3, 1.0, -0.3], [-0.4, 1.2, 0.1]])
    candidates = np.array([[2.5, 0, 0], [0, 0, 2.0], [-2.5, 0.01, 0]])
    found = suggest(HERE, pairs_at(on_line), candidates, cameras)
    assert found.candidate == 1
    assert found.weakness.kind == "rotation"
    np.testing.assert_allclose(np.abs(found.weakness.axis), [1, 0, 0], atol=0.1)
    assert found.weakness_left < 0.2


def test_the_first_places_are_suggested_before_anything_is_known_and_far_apart():
    grid = np.array([[x, y, z] for x in (-2, 0, 2) for y in (-2, 0, 2) for z in (-1, 1)], float)
    chosen = []
    for _ in range(4):
        found = suggest(HERE, pairs_at(grid[chosen]), grid, np.array([[0.0, 0, 0], [0.5, 0, 0.2]]))
        assert found.candidate not in chosen
        assert found.cameras_after_m < found.cameras_before_m
        chosen.append(found.candidate)
    assert np.linalg.svd(grid[chosen] - grid[chosen].mean(axis=0), compute_uv=False)[1] > 1.5


def test_pairs_that_fit_worse_than_expected_raise_the_uncertainty_that_is_told():
    rng = np.random.default_rng(1)
    places = rng.normal(0, 2, (8, 3))
    exact = pairs_at(places)
    worse = Correspondences(exact.names, exact.groups, places, places + rng.normal(0, 0.2, (8, 3)), exact.sigma_m)
    one, other = (suggest(HERE, pairs, places[:3] * 1.5, np.zeros((2, 3))) for pairs in (exact, worse))
    assert other.cameras_before_m > 5 * one.cameras_before_m


def test_without_candidates_or_cameras_nothing_is_suggested():
    assert suggest(HERE, pairs_at([]), np.zeros((0, 3)), np.zeros((2, 3))) is None
    assert suggest(HERE, pairs_at([]), np.zeros((2, 3)), np.zeros((0, 3))) is None
