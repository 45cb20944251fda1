"""A fillet whose points came as two planes: proposed as one surface that touches the faces on both sides."""

import numpy as np
import pytest
from brepgaussian.brep.facets import facets_as_fillets, lone_facets
from brepgaussian.brep.patches import Patch
from brepgaussian.geometry.rolling import rolling, touching
from brepgaussian.geometry.surfaces import cone, cylinder, plane

NOISE, WIDE, RADIUS = 0.001, 0.6, 0.06
EX, EY, EZ = np.eye(3)


def patch(surface, xyz, primitive, rng):
    """A patch with noisy points and the exact normals."""
    normals = surface.normals(xyz)
    return Patch(surface, primitive, xyz + rng.normal(0, NOISE, xyz.shape), normals, 0.02, NOISE)


def bend(rng, radius, count=1500):
    """A floor and a wall with a bend in between, in the corner of z = 0 and x = 0; the bend as two tangent planes."""
    floor, wall = plane(np.zeros(3), EZ), plane(np.zeros(3), EX)
    round_ = rolling(floor, wall, -radius)
    across, y = rng.uniform(radius, 0.5, count), rng.uniform(0, WIDE, count)
    patches = [
        patch(floor, np.column_stack([across, y, 0 * y]), 0, rng),
        patch(wall, np.column_stack([0 * y, y, across]), 1, rng),
    ]
    for k, (low, high) in enumerate([(180, 225), (225, 270)]):
        turn, y = np.radians(rng.uniform(low, high, count // 3)), rng.uniform(0, WIDE, count // 3)
        xyz = np.column_stack([radius + radius * np.cos(turn), y, radius + radius * np.sin(turn)])
        middle = round_.project(xyz.mean(axis=0)[None])[0]
        facet = plane(middle, round_.normals(middle[None])[0])
        patches.append(Patch(facet, 2 + k, xyz + rng.normal(0, NOISE, xyz.shape), round_.normals(xyz), 0.02, NOISE))
    return patches, round_


@pytest.mark.parametrize("seed", [3, 4, 5])
@pytest.mark.parametrize("radius", [0.03, RADIUS])
def test_two_facets_of_a_bend_are_one_cylinder_that_touches_both_faces(seed, radius):
    patches, right = bend(np.random.default_rng(seed), radius)
    changes = list(facets_as_fillets(patches, NOISE, np.random.default_rng(0)))
    assert [c.gone for c in changes] == [(2, 3)]
    made = changes[0].new[0].surface
    assert made.kind == "cylinder"
    assert made.flipped
    assert made.radius == pytest.approx(radius, rel=0.03)
    np.testing.assert_allclose(made.signed_distance(right.project(patches[2].xyz)), 0, atol=NOISE)


def test_two_facets_around_a_shaft_are_one_torus():
    rng = np.random.default_rng(6)
    wall, floor, inner, tube = cylinder(np.zeros(3), EZ, 0.2), plane(np.zeros(3), EZ), 0.2, 0.05
    right = touching(wall, floor, -tube)
    parts = []
    for k, (low, high) in enumerate([(180, 225), (225, 270)]):
        t, a = np.radians(rng.uniform(low, high, 900)), rng.uniform(0, 2 * np.pi, 900)
        r, z = inner + tube + tube * np.cos(t), tube + tube * np.sin(t)
        xyz = np.column_stack([r * np.cos(a), r * np.sin(a), z])
        facet = cone(np.array([0, 0, z.mean()]), -EZ, r.mean(), np.radians(22.5 + 45 * k))
        points = xyz + rng.normal(0, NOISE, xyz.shape)
        parts.append(Patch(facet, 2 + k, points, right.normals(xyz), 0.02, NOISE))
    a, r = rng.uniform(0, 2 * np.pi, 2000), rng.uniform(0.25, 0.45, 2000)
    around = np.column_stack([np.cos(a), np.sin(a)])
    patches = [
        patch(wall, np.column_stack([0.2 * around, rng.uniform(0.05, 0.4, 2000)]), 0, rng),
        patch(floor, np.column_stack([r[:, None] * around, 0 * r]), 1, rng),
        *parts,
    ]
    changes = list(facets_as_fillets(patches, NOISE, np.random.default_rng(0)))
    assert [c.gone for c in changes] == [(2, 3)]
    assert changes[0].new[0].surface.kind == "torus"
    assert changes[0].new[0].surface.minor == pytest.approx(tube, rel=0.05)


def test_a_chamfer_of_two_planes_is_none():
    """Planes that meet at 45 degrees and are flat: the fillet between their neighbours stands off them."""
    rng = np.random.default_rng(7)
    patches, _ = bend(rng, 0.2)
    for k in (2, 3):
        p = patches[k]
        flat = p.surface.project(p.xyz) + rng.normal(0, NOISE / 4, p.xyz.shape)
        normals = np.tile(p.surface.axis, (len(flat), 1))
        patches[k] = Patch(p.surface, p.primitive, flat, normals, p.reach, NOISE / 4)
    assert list(facets_as_fillets(patches, NOISE / 4, np.random.default_rng(0))) == []


@pytest.mark.parametrize("radius", [0.03, RADIUS])
@pytest.mark.parametrize("side", [1, -1])
def test_a_strip_across_an_edge_is_a_fillet_that_touches_both_faces(radius, side):
    """The strip's points lie on a plane, up to a quarter of the fillet's depth off it."""
    rng, reach = np.random.default_rng(8), 0.5 * side
    floor, wall = plane(np.zeros(3), EZ), plane(np.zeros(3), EX)
    far, y = rng.uniform(min(reach, 0), max(reach, 0), 3000), rng.uniform(0, WIDE, 3000)
    far = far[np.abs(far) > radius]
    y = y[: len(far)]
    round_ = rolling(floor, wall, -side * radius)
    turn = np.radians(rng.uniform(0, 90, 800))
    on = round_.project(side * radius * np.column_stack([1 - np.cos(turn), 0 * turn, 1 - np.sin(turn)]))
    lean = plane(on.mean(axis=0), np.array([1, 0, 1]) / np.sqrt(2))
    strip = 0.7 * on + 0.3 * lean.project(on)
    strip[:, 1] = rng.uniform(0, WIDE, len(strip))
    normals = np.tile(lean.axis, (len(strip), 1))
    patches = [
        patch(floor, np.column_stack([far, y, 0 * y]), 0, rng),
        patch(wall, np.column_stack([0 * y, y, far]), 1, rng),
        Patch(lean, 2, strip + rng.normal(0, NOISE, strip.shape), normals, 0.02, NOISE),
    ]
    (change,) = lone_facets(patches)
    made = change.new[0].surface
    assert change.gone == (2,)
    assert made.kind == "cylinder"
    assert made.flipped == (side > 0)  # concave where the faces look at each other
    assert made.radius == pytest.approx(radius, rel=0.15)
    assert lone_facets(patches[:2]) == []
