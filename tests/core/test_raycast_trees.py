"""Rays against a mesh split over several trees give what one tree gives."""

import numpy as np
import pytest
import trimesh

from gazeloc_core.scan import Mesh
from gazeloc_core.surfaces.raycast import Raycaster


@pytest.fixture(scope="module")
def casters():
    ball = trimesh.creation.icosphere(3)
    rng = np.random.default_rng(0)
    faces = rng.permutation(ball.faces)  # every tree then has faces everywhere
    colors = rng.integers(0, 255, ball.vertices.shape)
    mesh = Mesh(ball.vertices * (1, 2, 0.5), faces, colors.astype(np.uint8))
    return Raycaster(mesh), Raycaster(mesh, faces_per_tree=300)


def test_rays_meet_the_same_faces_at_the_same_places(casters):
    rng = np.random.default_rng(1)
    origins, directions = rng.normal(0, 1.5, (2000, 3)), rng.normal(size=(2000, 3))
    one, split = (caster.cast(origins, directions) for caster in casters)
    assert 200 < one.is_hit.sum() < 2000
    np.testing.assert_array_equal(split.is_hit, one.is_hit)
    np.testing.assert_allclose(split.distance, one.distance, rtol=1e-5)
    points = [caster.points(hits) for caster, hits in zip(casters, (one, split), strict=True)]
    np.testing.assert_allclose(points[1], points[0], atol=1e-5)
    assert (split.face == one.face).mean() > 0.999  # but for rays through an edge


def test_the_nearest_places_are_the_same(casters):
    points = np.random.default_rng(2).normal(size=(500, 3))
    one, split = (caster.closest(points) for caster in casters)
    np.testing.assert_allclose(split.distance, one.distance, atol=1e-6)
    found = casters[1].points(split)  # where two places are equally near, either will do
    np.testing.assert_allclose(np.linalg.norm(found - points, axis=1), one.distance, atol=1e-5)


def test_no_ray_at_all_is_no_hit_at_all(casters):
    assert len(casters[1].cast(np.zeros((0, 3)), np.zeros((0, 3))).face) == 0
