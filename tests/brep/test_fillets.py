"""Fillets between a cylinder and a plane: tori that touch both, found from points that know them badly."""

from dataclasses import replace

import numpy as np
import pytest
from brepgaussian.brep.fillets import rounded, touching
from brepgaussian.brep.patches import Patch
from brepgaussian.geometry.surfaces import cone, cylinder, plane, torus

AXIS, RADIUS, TUBE = np.array([0.0, 0.0, 1.0]), 0.2, 0.05
MIDDLE = np.array([0.5, 0.5, 0.4])


def patch(surface, rng, height, radius, count=2000):
    """Points on a surface of revolution about z, in ranges of height and radius; the exact normals."""
    turn, t = rng.uniform(0, 2 * np.pi, count), rng.uniform(0, 1, count)
    r, z = (low + (high - low) * t for low, high in (radius, height))
    xyz = surface.project(MIDDLE + np.column_stack([r * np.cos(turn), r * np.sin(turn), z]))
    return Patch(surface, 0, xyz, surface.normals(xyz), 0.02, 0.001)


@pytest.mark.parametrize(("convex", "bore"), [(True, False), (False, False), (True, True), (False, True)])
def test_the_torus_touches_both_faces_on_the_right_side(convex, bore):
    wall = cylinder(MIDDLE, AXIS, RADIUS, bore)
    floor = plane(MIDDLE + 0.1 * AXIS, AXIS)
    tube = TUBE if convex else -TUBE
    found = touching(wall, floor, tube)
    ring = RADIUS - tube * wall.sign
    ends = MIDDLE + np.array([[ring, 0, 0.1], [RADIUS, 0, 0.1 - tube]])  # on the floor and on the wall
    np.testing.assert_allclose(found.signed_distance(ends), 0, atol=1e-12)
    np.testing.assert_allclose(found.normals(ends), [floor.axis, [wall.sign, 0, 0]], atol=1e-9)


def shoulder(rng):
    """A shaft, its shoulder, and the inner fillet between them as a torus with a wrong tube and a leaning axis."""
    wall, floor = cylinder(MIDDLE, AXIS, RADIUS), plane(MIDDLE, AXIS)
    ring = RADIUS + TUBE
    right = torus(MIDDLE + TUBE * AXIS, AXIS, ring, TUBE, True)
    part = patch(right, rng, (TUBE, 0), (RADIUS, ring))
    wrong = torus(MIDDLE + 0.8 * TUBE * AXIS, AXIS + 0.01 * np.eye(3)[0], RADIUS + 0.8 * TUBE, 0.8 * TUBE, True)
    bad = Patch(wrong, 1, part.xyz, part.normals, part.reach, 0.003)
    return [patch(wall, rng, (TUBE, 0.4), (RADIUS, RADIUS)), bad, patch(floor, rng, (0, 0), (ring, 0.4))]


def test_a_fillet_gets_the_radius_that_its_points_show():
    patches = shoulder(np.random.default_rng(1))
    found = rounded(patches, 0.001)
    assert [found[0], found[2]] == [patches[0], patches[2]]
    surface = found[1].surface
    assert surface.minor == pytest.approx(TUBE, abs=1e-4)
    assert surface.radius == pytest.approx(RADIUS + TUBE, abs=1e-4)
    np.testing.assert_allclose(surface.axis, AXIS, atol=1e-12)


def test_chamfers_and_tori_without_neighbours_stay():
    patches = shoulder(np.random.default_rng(1))
    assert rounded(patches[1:], 0.001) is None
    assert rounded(rounded(patches, 0.001), 0.001) is None
    patches[1] = replace(patches[1], surface=cone(MIDDLE, AXIS, RADIUS + TUBE, np.pi / 4))
    assert rounded(patches, 0.001) is None
