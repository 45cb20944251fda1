"""Shoulders of flats on shafts, against shafts whose shoulders are known."""

import numpy as np
import pytest
from brepgaussian.brep.flats import ends_of_flats
from brepgaussian.brep.patches import Patch
from brepgaussian.geometry.surfaces import cylinder, plane

RADIUS, REACH = 0.2, 0.01
UP = np.array([0.0, 0.0, 1.0])


def patch(surface, points) -> Patch:
    return Patch(surface, 0, points, surface.normals(points), REACH, 0.001)


def shaft(rng, depth: float, low: float, high: float, span: float = 1.0, flipped: bool = False) -> list[Patch]:
    """A shaft from 0 to 1 with a flat facing x, `depth` radii from its axis, between two heights.

    The wall has points beside the flat, too, within `1 - span` of its angle."""
    angle, z = rng.uniform(-np.pi, np.pi, 4000), rng.uniform(0, 1, 4000)
    gone = (np.abs(angle) < span * np.arccos(depth)) & (z > low) & (z < high)
    wall = RADIUS * np.column_stack([np.cos(angle), np.sin(angle), z / RADIUS])[~gone]
    half = RADIUS * np.sqrt(1 - depth**2)
    flat = np.column_stack([np.full(600, depth * RADIUS), rng.uniform(-half, half, 600), rng.uniform(low, high, 600)])
    round_wall = cylinder(np.zeros(3), UP, RADIUS)
    return [
        patch(round_wall.flip() if flipped else round_wall, wall),
        patch(plane([depth * RADIUS, 0, 0.5], [1.0, 0, 0]), flat),
        patch(plane([0, 0, 1], UP), np.column_stack([rng.uniform(-0.1, 0.1, (50, 2)), np.ones(50)])),
    ]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("depth", [0.5, 0.8, 0.93])
def test_a_flat_between_two_shoulders_ends_at_both(seed, depth):
    found = ends_of_flats(shaft(np.random.default_rng(seed), depth, 0.3, 0.7))
    assert len(found) == 2
    heights = sorted((float(p.surface.origin[2]), float(p.surface.axis[2])) for p in found)
    assert heights[0] == pytest.approx((0.3, 1.0), abs=2 * REACH)  # looks up, into the flat
    assert heights[1] == pytest.approx((0.7, -1.0), abs=2 * REACH)
    for p in found:
        reach = np.linalg.norm(p.xyz[:, :2], axis=1)
        assert (p.xyz[:, 0] > depth * RADIUS).all()
        assert (reach < RADIUS).all()
        np.testing.assert_allclose(p.surface.signed_distance(p.xyz), 0, atol=1e-12)


def test_a_flat_that_runs_out_has_one():
    (found,) = ends_of_flats(shaft(np.random.default_rng(4), 0.8, 0.6, 1.0))
    assert found.surface.origin[2] == pytest.approx(0.6, abs=2 * REACH)


def test_a_shoulder_that_is_known_is_not_made_again():
    rng = np.random.default_rng(5)
    parts = shaft(rng, 0.6, 0.6, 1.0)
    moon = np.column_stack(
        [rng.uniform(0.61 * RADIUS, 0.95 * RADIUS, 30), rng.uniform(-0.05, 0.05, 30), np.full(30, 0.6)]
    )
    assert ends_of_flats([*parts, patch(plane([0, 0, 0.6], UP), moon)]) == []


@pytest.mark.parametrize("seed", range(2))
def test_what_is_no_flat_of_a_shaft_has_none(seed):
    rng = np.random.default_rng(seed)
    assert ends_of_flats(shaft(rng, 0.8, 0.3, 0.7, flipped=True)) == []  # a bore
    assert ends_of_flats(shaft(rng, 0.1, 0.3, 0.7)) == []  # a step down to the axis
    assert ends_of_flats(shaft(rng, 0.8, 0.3, 0.7, span=0.2)) == []  # the wall goes on beside it
    assert ends_of_flats(shaft(rng, 0.8, 0.0, 1.0)) == []  # from end to end
