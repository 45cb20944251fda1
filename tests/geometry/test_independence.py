"""Errors that are every point's own make more observations than smooth ones, and tell the kind of a surface better."""

import numpy as np
import pytest
from brepgaussian.geometry.fit import choose
from brepgaussian.geometry.independence import observations, own_share, shared_errors
from brepgaussian.geometry.surfaces import cylinder, plane
from sampled_surfaces import noisy, sample

SIGMA, TURN = 0.005, np.radians(6.0)
FLAT = plane(np.full(3, 0.5), np.array([0.0, 0.0, 1.0]))


def smooth(points, rng):
    """Errors (N,) of rms SIGMA that neighbours have in common."""
    wave = rng.normal(size=3) * 20
    return np.sqrt(2) * SIGMA * np.sin(points @ wave + rng.uniform(0, 6))


@pytest.mark.parametrize("seed", range(4))
def test_own_errors_are_told_from_smooth_ones(seed):
    rng = np.random.default_rng(seed)
    points, normals = sample(FLAT, 800, rng, height=0.5)
    own = noisy(points, normals, SIGMA, rng, TURN)[0]
    assert own_share(*shared_errors(FLAT, own, 4 * SIGMA)) > 0.8
    waved = points + smooth(points, rng)[:, None] * normals
    assert own_share(*shared_errors(FLAT, waved, 4 * SIGMA)) == 0


def test_few_points_tell_nothing():
    points = sample(FLAT, 8, np.random.default_rng(5), height=0.5)[0]
    assert shared_errors(FLAT, points, 1.0)[0] == 1


def test_observations_lie_between_the_least_and_all_points():
    assert observations(1000, 0.0, 20) == pytest.approx(20)
    assert observations(1000, 1.0, 20) == pytest.approx(1000)
    assert observations(7, 0.5, 20) == pytest.approx(7)
    many = [observations(1000, own, 20) for own in np.linspace(0, 1, 11)]
    assert np.all(np.diff(many) > 0)


@pytest.mark.parametrize("seed", range(6))
def test_own_errors_show_an_arc_and_a_plane_within_the_noise(seed):
    rng = np.random.default_rng(seed)
    arc = sample(cylinder(np.full(3, 0.5), np.array([0.0, 0.0, 1.0]), 0.5), 500, rng, arc=0.5, height=0.3)
    flat = sample(FLAT, 500, rng, height=0.25)
    for (points, normals), kind in ((arc, "cylinder"), (flat, "plane")):
        found = choose(*noisy(points, normals, SIGMA, rng, TURN), SIGMA, normal_sigma=TURN, own=0.95)
        assert found.surface.kind == kind


@pytest.mark.parametrize("seed", range(6))
def test_a_smooth_patch_of_a_cloud_with_own_errors_stays_simple(seed):
    rng = np.random.default_rng(seed)
    points, normals = sample(FLAT, 500, rng, height=0.5)
    waved = points + 0.6 * smooth(points, rng)[:, None] * normals
    assert choose(waved, normals, SIGMA / 2, normal_sigma=TURN, own=0.95).surface.kind == "plane"


@pytest.mark.parametrize(("size", "low", "high"), [(0.0, 0.0, 0.0), (1e-7, 0.0, 0.0), (0.002, 0.9, 1.0)])
def test_errors_of_rounding_have_nothing_in_common(size, low, high):
    """Waves along a plane: of a reconstruction's size they are shared, below it nobody asks."""
    xyz = np.column_stack([np.random.default_rng(4).random((500, 2)), np.zeros(500)])
    xyz[:, 2] = size * np.sin(6 * xyz[:, 0])
    shared, count = shared_errors(plane(np.zeros(3), np.array([0, 0, 1.0])), xyz, 3.5 * size)
    assert low <= shared <= high
    assert count == 500
