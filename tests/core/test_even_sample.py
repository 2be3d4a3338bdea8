"""The even sample of a cloud: its size, its evenness against plain thinning, and what odd clouds do to it."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from gazeloc_core.surfaces.even_sample import even_sample


def crowded(count: int) -> np.ndarray:
    """A room's floor where nine points of ten lie in one corner."""
    rng = np.random.default_rng(0)
    few, many = rng.random((count // 10, 3)) * (6, 4, 0.01), rng.random((count - count // 10, 3)) * (0.6, 0.4, 0.01)
    return rng.permutation(np.concatenate([few, many]))


def test_it_has_exactly_as_many_as_asked_for_each_once_and_is_fixed():
    points = crowded(20_000)
    rows = even_sample(points, 3000)
    assert len(rows) == len(np.unique(rows)) == 3000
    assert (np.diff(rows) > 0).all()
    np.testing.assert_array_equal(rows, even_sample(points.copy(), 3000))


def test_no_place_is_left_bare_as_it_would_be_by_taking_every_nth():
    points = crowded(20_000)
    gaps = [
        cKDTree(points[rows]).query(points)[0].max() for rows in (even_sample(points, 2000), np.arange(0, 20_000, 10))
    ]
    assert gaps[0] < 0.5 * gaps[1]


def test_a_small_cloud_is_kept_whole():
    np.testing.assert_array_equal(even_sample(np.zeros((7, 3)), 10), np.arange(7))


@pytest.mark.parametrize(
    "points",
    [
        np.zeros((500, 3)),
        np.concatenate([np.random.default_rng(0).random((490, 3)), [[1e9, 0, 0]] * 10]),
        np.concatenate([np.random.default_rng(0).random((490, 3)), np.full((10, 3), np.nan)]),
        np.full((500, 3), np.nan),
    ],
    ids=["one place", "strays far away", "some not finite", "none finite"],
)
def test_odd_clouds_give_a_sample_of_the_right_size(points):
    rows = even_sample(points, 100)
    assert len(np.unique(rows)) == 100
    if np.isfinite(points).all(axis=1).any():
        assert np.isfinite(points[rows]).all()
