"""Fits against the surfaces that the points were drawn from."""

import numpy as np
import pytest
from brepgaussian.geometry.fit import choose, distance_jacobian, fit, fit_robust, moved, ransac, refine
from brepgaussian.geometry.fit_refine import PARAMETERS
from brepgaussian.geometry.surfaces import KINDS, cylinder, plane
from hypothesis import given, settings
from hypothesis import strategies as st
from sampled_surfaces import noisy, random_surface, sample

SEEDS = st.integers(0, 10**6)


def gap(surface, points, normals):
    """Mean distance and mean angle (degrees) of a fit from clean points."""
    angle = np.arccos(np.clip((surface.normals(points) * normals).sum(1), -1, 1))
    return np.abs(surface.signed_distance(points)).mean(), np.degrees(angle).mean()


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=20, deadline=None)
@given(seed=SEEDS)
def test_jacobian_agrees_with_finite_differences(kind, seed):
    rng = np.random.default_rng(seed)
    surface = random_surface(kind, rng)
    points, _ = sample(surface, 25, rng)
    points += 0.02 * rng.normal(size=points.shape)
    anchor = points.mean(0) if rng.integers(2) else None
    _, jacobian = distance_jacobian(surface, points)
    step = 1e-6
    for column in range(PARAMETERS[kind]):
        delta = np.zeros(PARAMETERS[kind])
        delta[column] = step
        ahead = distance_jacobian(moved(surface, delta, anchor), points)[0]
        behind = distance_jacobian(moved(surface, -delta, anchor), points)[0]
        np.testing.assert_allclose(jacobian[:, column], (ahead - behind) / (2 * step), atol=1e-5)


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=25, deadline=None)
@given(seed=SEEDS, arc=st.sampled_from([1.2, 2.0, 2 * np.pi]))
def test_clean_points_give_the_surface_back(kind, seed, arc):
    rng = np.random.default_rng(seed)
    points, normals = sample(random_surface(kind, rng), 300, rng, arc)
    distance, angle = gap(fit(kind, points, normals), points, normals)
    assert distance < 1e-6
    assert angle < 1e-2


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("sigma", [0.002, 0.005, 0.01])
def test_noise_averages_out(kind, sigma):
    rng = np.random.default_rng(11)
    errors = []
    for _ in range(8):
        points, normals = sample(random_surface(kind, rng), 1000, rng, arc=3.0)
        errors.append(gap(fit(kind, *noisy(points, normals, sigma, rng, np.radians(5))), points, normals)[0])
    assert np.median(errors) < 4 * sigma * np.sqrt(PARAMETERS[kind] / 1000)


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=8, deadline=None)
@given(seed=SEEDS)
def test_fit_turns_with_the_points(kind, seed):
    rng = np.random.default_rng(seed)
    points, normals = sample(random_surface(kind, rng), 200, rng)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    surface = fit(kind, 3 * points @ turn.T + 1, normals @ turn.T)
    assert np.abs(surface.signed_distance(3 * points @ turn.T + 1)).max() < 1e-5


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("outward", [1, -1])
def test_orientation_follows_the_normals(kind, outward):
    rng = np.random.default_rng(3)
    points, normals = sample(random_surface(kind, rng), 200, rng, arc=2.0)
    surface = fit(kind, points, outward * normals)
    assert ((surface.normals(points) * outward * normals).sum(1) > 0.99).all()
    if kind == "plane":
        assert not surface.flipped


@pytest.mark.parametrize("kind", KINDS)
def test_wrong_labels_do_not_move_a_robust_fit(kind):
    rng = np.random.default_rng(17)
    for _ in range(5):
        clean, clean_normals = sample(random_surface(kind, rng), 600, rng, arc=2.5)
        points, normals = noisy(clean, clean_normals, 0.002, rng, np.radians(4))
        wrong = rng.random(600) < 0.1
        points[wrong] = rng.uniform(0, 1, (wrong.sum(), 3))
        normals[wrong] = rng.normal(size=(wrong.sum(), 3))
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        surface, mask = fit_robust(kind, points, normals, 0.002)
        assert gap(surface, clean, clean_normals)[0] < 0.0008
        assert mask[~wrong].mean() > 0.95


def test_wrong_labels_do_not_turn_a_small_plane():
    rng = np.random.default_rng(4)
    n = 60
    clean = np.column_stack([rng.uniform(0, 0.05, n), rng.uniform(0, 0.05, n), np.zeros(n)])
    points = clean + 0.002 * rng.normal(size=clean.shape)
    normals = np.tile([0.0, 0, 1], (n, 1))
    points[:3] = [[0.02, 0.02, -0.4], [0.0, 0.3, -0.2], [0.4, 0.0, -0.3]]
    normals[:3] = [1.0, 0, 0]
    surface, mask = fit_robust("plane", points, normals)
    assert surface.axis[2] > np.cos(np.radians(4))
    assert not mask[:3].any()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("sigma", [0.0, 0.002, 0.005])
def test_the_right_kind_is_chosen(kind, sigma):
    rng = np.random.default_rng(23)
    for _ in range(4):
        points, normals = sample(random_surface(kind, rng), 500, rng)
        points, normals = noisy(points, normals, sigma, rng, np.radians(3) * (sigma > 0))
        assert choose(points, normals, max(sigma, 0.001)).surface.kind == kind


def test_a_tiny_patch_of_a_big_cylinder_stays_simple():
    rng = np.random.default_rng(5)
    big = cylinder(np.zeros(3), np.array([0.0, 0, 1]), 0.5)
    points, normals = sample(big, 400, rng, arc=0.1, height=0.05)
    assert choose(*noisy(points, normals, 0.002, rng, np.radians(4)), 0.002).surface.kind == "plane"


def test_smooth_error_does_not_bend_a_plane():
    rng = np.random.default_rng(6)
    for _ in range(5):
        points, normals = sample(plane(np.full(3, 0.5), rng.normal(size=3)), 800, rng, height=0.5)
        wave = rng.normal(size=3) * 8
        error = 0.004 * np.sin(points @ wave + rng.uniform(0, 6))
        assert choose(points + error[:, None] * normals, normals, 0.003).surface.kind == "plane"


def test_ransac_finds_the_larger_of_two_faces():
    rng = np.random.default_rng(7)
    first, first_normals = sample(plane(np.full(3, 0.5), [0.0, 0, 1]), 500, rng)
    shaft = cylinder([0.9, 0.5, 0.5], [0.0, 1, 0], 0.2)
    second, second_normals = sample(shaft, 900, rng)
    points, normals = noisy(
        np.concatenate([first, second]), np.concatenate([first_normals, second_normals]), 0.002, rng, 0.05
    )
    surface, mask = ransac(points, normals, KINDS, 0.008, np.radians(20), rng)
    assert surface.kind == "cylinder"
    assert abs(surface.radius - 0.2) < 0.002
    assert mask[500:].mean() > 0.95
    rest = ~mask
    surface, _ = ransac(points[rest], normals[rest], KINDS, 0.008, np.radians(20), rng)
    assert surface.kind == "plane"


@pytest.mark.parametrize("kind", KINDS)
def test_degenerate_points_give_a_finite_surface_or_a_clear_error(kind):
    rng = np.random.default_rng(8)
    line = np.linspace(0, 1, 50)[:, None] * np.array([1.0, 2, 3]) / 4
    flat = np.column_stack([rng.uniform(0, 1, (50, 2)), np.zeros(50)])
    up = np.tile([0.0, 0, 1], (50, 1))
    for points in (line, flat, np.zeros((50, 3))):
        try:
            surface = fit(kind, points, up)
        except ValueError:
            continue
        assert np.isfinite([*surface.origin, *surface.axis, surface.radius, surface.minor, surface.angle]).all()


def test_too_few_points_are_refused():
    with pytest.raises(ValueError, match="needs"):
        fit("torus", np.zeros((2, 3)), np.tile([0.0, 0, 1], (2, 1)))


def test_refine_never_raises_the_cost():
    rng = np.random.default_rng(9)
    for kind in KINDS:
        points, _ = sample(random_surface(kind, rng), 200, rng)
        start = random_surface(kind, rng)
        before, after = start.signed_distance(points), refine(start, points).signed_distance(points)
        assert (after**2).sum() <= (before**2).sum() * (1 + 1e-9)
