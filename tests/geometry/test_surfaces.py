"""Signed distances, normals and projections of the five surfaces against finite differences."""

import numpy as np
import pytest
from brepgaussian.geometry.surfaces import KINDS, surface_from_row, surface_to_row
from hypothesis import given, settings
from hypothesis import strategies as st
from sampled_surfaces import random_surface, sample


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_normals_are_the_gradient_of_the_distance(kind, seed):
    rng = np.random.default_rng(seed)
    surface = random_surface(kind, rng)
    points, _ = sample(surface, 30, rng)
    points += 0.02 * rng.normal(size=points.shape)
    step = 1e-6
    numeric = np.column_stack(
        [
            (surface.signed_distance(points + step * e) - surface.signed_distance(points - step * e)) / (2 * step)
            for e in np.eye(3)
        ]
    )
    np.testing.assert_allclose(surface.normals(points), numeric, atol=1e-5)
    flipped = surface.flip()
    for one in (surface, flipped):
        distance, normals = one.field(points)
        np.testing.assert_array_equal(distance, one.signed_distance(points))
        np.testing.assert_array_equal(normals, one.normals(points))


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_projection_lies_on_the_surface_and_is_nearest(kind, seed):
    rng = np.random.default_rng(seed)
    surface = random_surface(kind, rng)
    on, _ = sample(surface, 400, rng)
    points = on[:20] + 0.02 * rng.normal(size=(20, 3))
    projected = surface.project(points)
    np.testing.assert_allclose(surface.signed_distance(projected), 0, atol=1e-12)
    reach = np.linalg.norm(points - projected, axis=1)
    np.testing.assert_allclose(reach, np.abs(surface.signed_distance(points)), atol=1e-12)
    others = np.linalg.norm(points[:, None] - on[None], axis=2).min(1)
    assert (reach <= others + 1e-12).all()


@pytest.mark.parametrize("kind", KINDS)
def test_flip_turns_sign_and_normal(kind):
    rng = np.random.default_rng(1)
    surface = random_surface(kind, rng)
    points, normals = sample(surface, 20, rng)
    np.testing.assert_allclose(surface.normals(points), normals)
    np.testing.assert_allclose(surface.flip().normals(points), -normals)
    outside = points + 0.01 * normals
    np.testing.assert_allclose(surface.signed_distance(outside), 0.01, atol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_rows_round_trip(kind):
    surface = random_surface(kind, np.random.default_rng(2))
    again = surface_from_row(kind, surface_to_row(surface))
    np.testing.assert_array_equal(surface_to_row(again), surface_to_row(surface))
    assert again.flipped == surface.flipped
