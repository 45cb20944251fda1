"""Which cones, spheres and tori a part may have: slim cones show that they taper, narrow bands that they bend."""

import numpy as np
import pytest
from brepgaussian.geometry.fit import choose, plausible
from brepgaussian.geometry.fit_choose import TRIMMED, UNEXPLAINED, noise_floors
from brepgaussian.geometry.surfaces import cone, cylinder, sphere, torus


def side(surface, length, rng, count=1500, bias=0.0):
    """Points around a surface about z, `length` long, whose distance grows by `bias` from one end to the other."""
    turn, height = rng.uniform(0, 2 * np.pi, count), rng.uniform(-0.5, 0.5, count) * length
    radius = surface.radius + height * np.tan(surface.angle) + bias * height / length
    xyz = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), height])
    return xyz, surface.normals(xyz)


@pytest.mark.parametrize(("degrees", "length", "expected"), [(1.5, 0.7, True), (1.0, 0.3, False), (5.0, 0.05, True)])
def test_a_slim_cone_shows_that_it_tapers(degrees, length, expected):
    surface = cone(np.zeros(3), np.array([0.0, 0.0, 1.0]), 0.1, np.radians(degrees))
    points, _ = side(surface, length, np.random.default_rng(1))
    assert plausible(surface, points) == expected


def test_a_taper_is_a_cone_and_a_bore_that_is_off_at_one_end_a_cylinder():
    rng, axis = np.random.default_rng(2), np.array([0.0, 0.0, 1.0])
    taper = side(cone(np.zeros(3), axis, 0.06, np.radians(1.5)), 0.7, rng)
    bore = side(cylinder(np.zeros(3), axis, 0.06), 0.2, rng, bias=0.005)
    for (xyz, normals), kind in ((taper, "cone"), (bore, "cylinder")):
        noisy = xyz + rng.normal(0, 0.001, xyz.shape)
        assert choose(noisy, normals, 0.001).surface.kind == kind


@pytest.mark.parametrize(
    ("radius", "low", "high", "expected"),
    [(0.84, 28, 36, False), (0.4, 30, 70, True), (0.1, 40, 100, True), (0.39, 0, 60, True), (0.9, 0, 15, True)],
)
def test_a_narrow_band_is_no_sphere_and_a_cap_is(radius, low, high, expected):
    rng = np.random.default_rng(3)
    polar, turn = np.radians(rng.uniform(low, high, 3000)), rng.uniform(0, 2 * np.pi, 3000)
    out = np.column_stack([np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)])
    tilted = out @ np.linalg.qr(rng.normal(size=(3, 3)))[0]
    assert plausible(sphere(np.full(3, 0.2), radius), 0.2 + radius * tilted) == expected


@pytest.mark.parametrize(
    ("minor", "low", "high", "expected"), [(0.19, 80, 96, False), (0.02, 0, 90, True), (0.2, 0, 40, True)]
)
def test_a_narrow_ring_is_no_torus_and_a_fillet_is(minor, low, high, expected):
    rng = np.random.default_rng(4)
    profile, turn = np.radians(rng.uniform(low, high, 3000)), rng.uniform(0, 2 * np.pi, 3000)
    radius = 0.2 + minor * np.cos(profile)
    points = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), minor * np.sin(profile)])
    tilted = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    assert plausible(torus(np.full(3, 0.1), tilted[2], 0.2, minor), 0.1 + points @ tilted) == expected


@pytest.mark.parametrize("sigma", [0.001, 0.006])
@pytest.mark.parametrize(("radius", "expected"), [(0.35, False), (0.1, True)])
def test_a_little_bent_strip_may_be_a_plane_however_noisy_its_points_are(sigma, radius, expected):
    """A strip .1 wide that turns by 8 degrees to each side (a plane's bulge), or by 30."""
    rng = np.random.default_rng(4)
    surface = cylinder(np.zeros(3), np.array([0.0, 0.0, 1.0]), radius)
    turn, height = rng.uniform(-0.05, 0.05, 400) / radius, rng.random(400) * 0.2
    xyz = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), height])
    assert plausible(surface, xyz + sigma * rng.normal(size=xyz.shape)) == expected


@pytest.mark.parametrize("sigma", [0.5, 3.0])
def test_noise_floors_add_variances(sigma):
    """All errors the points' own: noise and best kind as they are; all smooth: with their allowances."""
    misfits = np.array([[1.0, 0.1], [2.0, 0.3]])
    own = noise_floors(sigma, 0.05, misfits, 1.0)
    smooth = noise_floors(sigma, 0.05, misfits, 0.0)
    half = noise_floors(sigma, 0.05, misfits, 0.5)
    np.testing.assert_allclose(own, [max(TRIMMED * sigma, 1.0), 0.1])
    np.testing.assert_allclose(smooth, [max(sigma, UNEXPLAINED), 0.1 * UNEXPLAINED])
    assert all(a < b < c for a, b, c in zip(own, half, smooth, strict=True))
