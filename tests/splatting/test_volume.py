"""The mesh of a field, against marching cubes that visit every cell."""

import numpy as np
import pytest
from brepgaussian.splatting.concave.volume import Volume
from hypothesis import given, settings
from hypothesis import strategies as st
from skimage.measure import marching_cubes


@given(st.integers(0, 10_000), st.integers(3, 9))
@settings(deadline=None, max_examples=40)
def test_cells_without_surface_add_nothing_to_the_mesh(seed, size):
    field = np.random.default_rng(seed).normal(size=(size, size + 1, size + 2)).astype(np.float32)
    field[np.abs(field) < 0.1] = 0.0  # nodes on the surface itself
    vertices, triangles, _, _ = marching_cubes(field, 0.0, gradient_direction="ascent")
    mesh = Volume(field, np.zeros(3), 1.0).mesh()
    np.testing.assert_array_equal(mesh[0], vertices)
    np.testing.assert_array_equal(mesh[1], triangles)


def test_a_box_is_closed():
    field = np.full((8, 8, 8), -1.0, np.float32)
    field[2:6, 3:6, 2:5] = 1.0
    vertices, triangles = Volume(field, np.zeros(3), 0.5).mesh()
    edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()
    assert vertices.min(axis=0).tolist() == pytest.approx([0.75, 1.25, 0.75])
