"""Slanting planes that are roundings: told from chamfers by their own points."""

import numpy as np
import pytest
from brep_support import patches_of
from brepgaussian.brep.slants import slants
from brepgaussian.geometry.surfaces import plane

X, Y, Z = np.eye(3)
CORNER = np.zeros(3)
R = 0.1


def corner(points, sign):
    """Two walls that meet at a right angle, convex or concave, and what lies between them."""
    rng = np.random.default_rng(7)
    far = rng.random((900, 3))
    left = np.column_stack([np.zeros(900), R * 0.6 + 0.4 * far[:, 1], far[:, 2]])
    down = np.column_stack([R * 0.6 + 0.4 * far[:, 0], np.zeros(900), far[:, 2]])
    middle = np.column_stack([points, rng.random(len(points))]) + 0.0004 * rng.normal(size=(len(points), 3))
    slant = plane(middle.mean(axis=0), -sign * (X + Y) / np.sqrt(2))
    walls = plane(CORNER, -sign * X), plane(CORNER, -sign * Y)
    patches = patches_of([*walls, slant], [left, down, middle])
    patches[2] = type(patches[2])(slant, 2, middle, patches[2].normals, 0.02, slant.rms(middle))
    return patches


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_middle_of_an_arc_is_a_rounding_of_both_neighbours(sign):
    """Points of 40 of the 90 degrees of an arc of known radius."""
    angle = np.radians(np.random.default_rng(3).uniform(205, 245, 400))
    (change,) = slants(corner(R + R * np.column_stack([np.cos(angle), np.sin(angle)]), sign))
    assert change.gone == (2,)
    surface = change.new[0].surface
    assert surface.kind == "cylinder"
    assert surface.radius == pytest.approx(R, abs=0.003)
    assert surface.flipped == (sign < 0)
    np.testing.assert_allclose(np.abs(surface.axis), Z, atol=1e-9)
    np.testing.assert_allclose(surface.origin[:2], surface.radius, atol=1e-9)  # it touches both walls


def test_a_chamfer_stays_a_plane():
    along = np.random.default_rng(3).random((400, 1))
    assert slants(corner(np.column_stack([along, 1 - along]) * 0.06, 1.0)) == []


def test_where_an_edge_is_refused_the_flat_middle_of_an_arc_may_be_a_rounding():
    """Points of 20 degrees, which a plane explains as well; other slants are not asked."""
    angle = np.radians(np.random.default_rng(3).uniform(215, 235, 400))
    patches = corner(R + R * np.column_stack([np.cos(angle), np.sin(angle)]), 1.0)
    patches[2].xyz[:, :2] += 0.0015 * np.random.default_rng(5).normal(size=(400, 2))
    patches[2] = type(patches[2])(patches[2].surface, 2, patches[2].xyz, patches[2].normals, 0.02, 0.0016)
    assert slants(patches) == []
    assert slants(patches, {0}) == []
    (change,) = slants(patches, {0, 2})
    assert change.new[0].surface.radius == pytest.approx(R, abs=0.01)
    assert slants(corner(np.random.default_rng(3).random((400, 1)) * [0.06, -0.06] + [0, 0.06], 1.0), {2}) == []
