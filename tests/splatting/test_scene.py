"""Questions to a hull's mesh that need no distance of every point: against all distances."""

import numpy as np
import pytest
import trimesh
from brepgaussian.splatting.concave.scene import Scene


@pytest.fixture(scope="module")
def scene():
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=0.4)
    return Scene(mesh.vertices + 0.5, mesh.faces)


@pytest.mark.parametrize("reach", [0.01, 0.1, 1.0])
def test_distances_near_the_mesh(scene, reach):
    points = np.random.default_rng(3).uniform(0, 1, (5000, 3))
    distance, near = scene.signed_distance(points), scene.near(points, reach)
    close = np.abs(distance) < reach
    np.testing.assert_array_equal(near[close], distance[close])
    np.testing.assert_array_equal(near[~close], np.copysign(np.inf, distance[~close]))


def test_inside(scene):
    points = np.random.default_rng(4).uniform(0, 1, (5000, 3))
    np.testing.assert_array_equal(scene.inside(points), scene.signed_distance(points) < 0)


def test_no_points(scene):
    none = np.zeros((0, 3))
    assert scene.near(none, 0.1).shape == scene.inside(none).shape == (0,)
