"""Local parameters against finite differences and round trips."""

import numpy as np
import pytest
from brepgaussian.brep.refine.parameters import COUNT, derivative, difference, prior_sigmas, recentre, update
from refine_support import random_surface

KINDS = tuple(COUNT)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(4))
def test_derivative_equals_finite_differences(kind, seed):
    rng = np.random.default_rng(seed)
    surface, points = random_surface(kind, rng), rng.uniform(-0.5, 1.5, (40, 3))
    exact, h = derivative(surface, points), 1e-6
    for k in range(COUNT[kind]):
        delta = np.zeros(COUNT[kind])
        delta[k] = h
        plus, minus = update(surface, delta), update(surface, -delta)
        numeric = (plus.signed_distance(points) - minus.signed_distance(points)) / (2 * h)
        np.testing.assert_allclose(exact[:, k], numeric, atol=2e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_difference_undoes_update_to_first_order(kind):
    rng = np.random.default_rng(5)
    start = random_surface(kind, rng)
    delta = 1e-5 * rng.normal(size=COUNT[kind])
    now = update(start, delta)
    points = rng.uniform(0, 1, (30, 3))
    back = update(now, -difference(start, now))
    np.testing.assert_allclose(back.signed_distance(points), start.signed_distance(points), atol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_recentre_keeps_the_surface_and_comes_near(kind):
    rng = np.random.default_rng(6)
    surface = random_surface(kind, rng)
    near = surface.project(rng.uniform(0.4, 0.6, (20, 3)))
    moved = recentre(surface, near)
    points = rng.uniform(0, 1, (30, 3))
    np.testing.assert_allclose(moved.signed_distance(points), surface.signed_distance(points), atol=1e-12)
    if kind in ("cylinder", "cone"):
        middle = 0.5 * (near.min(axis=0) + near.max(axis=0))
        assert abs((middle - moved.origin) @ moved.axis) < 1e-9


def test_prior_tells_angles_from_lengths():
    np.testing.assert_allclose(prior_sigmas("cone", 0.01, 0.003), [0.003, 0.003, 0.01, 0.01, 0.003, 0.01])
