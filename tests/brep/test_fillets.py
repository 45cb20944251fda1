"""Fillets between a cylinder and a plane: tori that touch both, found from points that know them badly."""

from dataclasses import replace

import numpy as np
import pytest
from brepgaussian.brep.fillets import rounded
from brepgaussian.brep.patches import Patch
from brepgaussian.geometry.rolling import rolling, touching
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


@pytest.mark.parametrize(("convex", "bore", "angle"), [(True, False, 0.2), (False, False, -0.2), (False, True, 0.3)])
def test_the_torus_touches_a_cone_and_a_plane(convex, bore, angle):
    """A tapered boss's foot: on a cone that grows along its axis, or against it."""
    wall = cone(MIDDLE, AXIS * np.sign(angle), RADIUS, abs(angle), bore)
    floor = plane(MIDDLE + 0.1 * AXIS, AXIS)
    found = touching(wall, floor, TUBE if convex else -TUBE)
    centre = found.origin + found.radius * np.eye(3)[0]  # of the tube
    for face in (wall, floor):
        ends = face.project(centre[None])
        np.testing.assert_allclose(np.linalg.norm(ends - centre), TUBE, atol=1e-12)
        np.testing.assert_allclose(found.signed_distance(ends), 0, atol=1e-12)
        np.testing.assert_allclose(found.normals(ends), face.normals(ends), atol=1e-9)


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


@pytest.mark.parametrize("convex", [True, False])
def test_the_rolling_cylinder_touches_both_planes_on_the_right_side(convex):
    rng = np.random.default_rng(3)
    for _ in range(20):
        first, second = (plane(MIDDLE + rng.uniform(-0.1, 0.1, 3), rng.normal(size=3)) for _ in range(2))
        found = rolling(first, second, TUBE if convex else -TUBE)
        for wall in (first, second):
            assert found.axis @ wall.axis == pytest.approx(0, abs=1e-12)
            contact = wall.project(found.origin[None])
            np.testing.assert_allclose(found.signed_distance(contact), 0, atol=1e-9)
            np.testing.assert_allclose(found.normals(contact)[0], wall.axis, atol=1e-9)
            assert (wall.signed_distance(found.origin[None])[0] < 0) == convex


def corner(rng, radius=0.09):
    """Two walls of a pocket (normals into the pocket), and the quarter cylinder between them, fitted badly."""
    low = MIDDLE - 0.3
    walls = [plane(low, np.eye(3)[0]), plane(low, np.eye(3)[1])]
    along, t = rng.uniform(0, 0.3, (3, 1500)), rng.uniform(0, 1, (3, 1500))
    turn = np.pi + t[2] * np.pi / 2
    axis = low + np.array([radius, radius, 0])
    round_ = axis + np.column_stack([radius * np.cos(turn), radius * np.sin(turn), along[2]])
    spots = [
        low + np.column_stack([0 * t[0], radius + 0.4 * t[0], along[0]]),
        low + np.column_stack([radius + 0.4 * t[1], 0 * t[1], along[1]]),
        round_ + rng.normal(0, 0.001, round_.shape),
    ]
    right = cylinder(axis, AXIS, radius, True)
    wrong = cylinder(axis + 0.004, AXIS + np.array([0.02, 0, 0]), radius + 0.003, True)
    made = zip([*walls, wrong], [*walls, right], spots, strict=True)
    return [Patch(s, i, xyz, r.normals(xyz), 0.02, 0.002) for i, (s, r, xyz) in enumerate(made)], right


def test_the_corner_of_a_pocket_touches_its_walls():
    patches, right = corner(np.random.default_rng(5))
    found = rounded(patches, 0.001)
    assert found[:2] == patches[:2]
    surface = found[2].surface
    assert surface.flipped
    assert surface.radius == pytest.approx(right.radius, abs=5e-4)
    assert abs(surface.axis @ AXIS) == pytest.approx(1, abs=1e-9)
    assert rounded(patches[:1] + patches[2:], 0.001) is None  # one wall is no corner


def test_the_end_of_a_slot_is_as_wide_as_the_slot():
    rng = np.random.default_rng(6)
    width, t, z = 0.1, rng.uniform(0, 1, (3, 1500)), rng.uniform(0, 0.1, (3, 1500))
    walls = [
        plane(MIDDLE - [0, width / 2, 0], np.eye(3)[1]),
        plane(MIDDLE + np.array([0, width / 2, 0]), -np.eye(3)[1]),
    ]
    turn = np.pi / 2 + np.pi * t[2]
    right = cylinder(MIDDLE, AXIS, width / 2, True)
    spots = [
        *(w.origin + np.column_stack([0.3 * t[k], 0 * t[k], z[k]]) for k, w in enumerate(walls)),
        MIDDLE + np.column_stack([width / 2 * np.cos(turn), width / 2 * np.sin(turn), z[2]]),
    ]
    wrong = cylinder(MIDDLE + np.array([0.003, 0.002, 0]), AXIS + np.array([0, 0.02, 0]), 0.055, True)
    made = zip([*walls, wrong], [*walls, right], spots, strict=True)
    patches = [Patch(s, i, xyz, r.normals(xyz), 0.02, 0.003) for i, (s, r, xyz) in enumerate(made)]
    surface = rounded(patches, 0.001)[2].surface
    assert surface.radius == pytest.approx(width / 2)
    np.testing.assert_allclose(surface.signed_distance(spots[2]), 0, atol=1e-4)


@pytest.mark.parametrize("lean_deg", [3.0, 8.0])
def test_the_walls_of_a_slot_with_round_ends_are_made_parallel(lean_deg):
    """Walls that lean as the points of a narrow keyway have them, each about its middle; the floor is known well."""
    rng = np.random.default_rng(8)
    width, deep, t = 0.1, 0.06, rng.uniform(0, 1, (4, 900))
    y, z = np.eye(3)[1], np.eye(3)[2]
    sides = [plane(MIDDLE - width / 2 * y, y), plane(MIDDLE + width / 2 * y, -y)]
    lean = np.tan(np.radians(lean_deg))
    patches = []
    for k, side in enumerate(sides):
        xyz = side.origin + np.column_stack([0.2 * t[0], 0 * t[0], deep * (t[1] - 0.5)])
        xyz += np.outer((xyz - MIDDLE) @ z * lean, side.axis)
        patches.append(
            Patch(plane(side.origin, side.axis - lean * z), k, xyz, np.tile(side.axis, (900, 1)), 0.02, 0.001)
        )
    turn = np.pi / 2 + np.pi * t[2]
    end = cylinder(MIDDLE, z, width / 2, True)
    xyz = MIDDLE + np.column_stack([width / 2 * np.cos(turn), width / 2 * np.sin(turn), deep * (t[3] - 0.5)])
    patches.append(Patch(cylinder(MIDDLE, z, 0.052, True), 2, xyz, end.normals(xyz), 0.02, 0.001))
    floor = plane(MIDDLE - deep / 2 * z, z)
    xyz = floor.origin + np.column_stack([0.2 * t[0], width * (t[1] - 0.5), 0 * t[0]])
    patches.append(Patch(floor, 3, xyz, np.tile(z, (900, 1)), 0.02, 0.001))
    result = rounded(patches, 0.001)
    for side, patch in zip(sides, result, strict=False):
        np.testing.assert_allclose(patch.surface.axis, side.axis, atol=2e-3)
        assert abs(patch.surface.signed_distance(side.origin[None])[0]) < 1e-3
    assert abs(result[0].surface.axis @ result[1].surface.axis) == pytest.approx(1, abs=1e-12)
    assert result[2].surface.radius == pytest.approx(width / 2, abs=1e-3)
    assert result[3].surface is floor
