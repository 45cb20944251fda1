"""Two straight faces of revolution under one label, against the surfaces that their points were taken from."""

import numpy as np
import pytest
from brepgaussian.brep.patches import Patch
from brepgaussian.brep.profiles import flattened, grooved, straightened, unbent
from brepgaussian.geometry.fit import fit_robust
from brepgaussian.geometry.surfaces import cone, cylinder, plane, torus, unit

NOISE = 0.001


def turned(surface, axis, middle, radii, heights, count, rng):
    """Noisy points and normals on a surface of revolution about an axis."""
    first = unit(np.cross(axis, [0.3, 0.5, 0.8]))
    second = np.cross(axis, first)
    share, angle = rng.uniform(0, 1, count), rng.uniform(0, 2 * np.pi, count)
    r, z = (low + share * (high - low) for low, high in (radii, heights))
    xyz = middle + r[:, None] * (np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * second) + z[:, None] * axis
    normals = surface.normals(xyz)
    return xyz + rng.normal(0, NOISE, xyz.shape), normals + rng.normal(0, 0.05, normals.shape)


def as_patch(xyz, normals, about):
    return Patch(about, 3, xyz, normals, 0.02, about.rms(xyz))


@pytest.mark.parametrize("seed", [31, 32, 33])
@pytest.mark.parametrize("kind", ["torus", "cone"])
def test_a_countersink_and_its_throat_come_apart(seed, kind):
    rng = np.random.default_rng(seed)
    axis, middle = unit(rng.normal(size=3)), rng.uniform(0.4, 0.6, 3)
    sink = cone(middle, axis, 0.05, np.radians(45), flipped=True)
    throat = cylinder(middle, axis, 0.05, flipped=True)
    parts = [
        turned(sink, axis, middle, (0.05, 0.09), (0, 0.04), 500, rng),
        turned(throat, axis, middle, (0.05, 0.05), (-0.04, 0), 220, rng),
    ]
    xyz, normals = (np.concatenate([p[k] for p in parts]) for k in (0, 1))
    arc = torus(middle - 0.045 * axis, axis, 0.13, 0.085, flipped=False)  # through both, and leaning
    leaning = torus(arc.origin, unit(axis + 0.03 * rng.normal(size=3)), arc.radius, arc.minor, arc.flipped)
    face = plane(middle + 0.04 * axis, axis)
    top = turned(face, axis, middle, (0.09, 0.2), (0.04, 0.04), 800, rng)
    own = leaning if kind == "torus" else fit_robust("cone", xyz, normals, NOISE)[0]
    patches = [Patch(face, 0, *top, 0.02, NOISE), as_patch(xyz, normals, own)]
    (change,) = straightened(patches)
    assert change.gone == (1,)
    assert len({0, *(p.primitive for p in change.new)}) == 3
    by_kind = {p.surface.kind: p.surface for p in change.new}
    assert set(by_kind) == {"cone", "cylinder"}
    assert by_kind["cylinder"].radius == pytest.approx(0.05, abs=0.001)
    assert np.degrees(by_kind["cone"].angle) == pytest.approx(45, abs=2.5)
    for surface, (points, directions) in zip((by_kind["cone"], by_kind["cylinder"]), parts, strict=True):
        assert surface.rms(points) < 2 * NOISE
        assert (np.einsum("ij,ij->i", surface.normals(points), directions) > 0.8).mean() > 0.95


@pytest.mark.parametrize("seed", [41, 42])
def test_a_fillet_stays_a_torus(seed):
    rng = np.random.default_rng(seed)
    angle, turn = rng.uniform(0, np.pi / 2, 1500), rng.uniform(0, 2 * np.pi, 1500)
    r, z = 0.25 - 0.05 * np.cos(angle), 0.05 - 0.05 * np.sin(angle)
    xyz = np.column_stack([r * np.cos(turn), r * np.sin(turn), z]) + rng.normal(0, NOISE, (1500, 3))
    fillet = torus(np.array([0, 0, 0.05]), np.array([0, 0, 1.0]), 0.25, 0.05, True)
    surface = fit_robust("torus", xyz, fillet.normals(xyz), NOISE)[0]
    assert straightened([as_patch(xyz, surface.normals(xyz), surface)]) == []


@pytest.mark.parametrize("seed", [51, 52])
def test_a_cone_stays_a_cone(seed):
    rng = np.random.default_rng(seed)
    sink = cone(np.zeros(3), np.array([0, 0, 1.0]), 0.05, np.radians(40), flipped=True)
    points = turned(sink, sink.axis, np.zeros(3), (0.05, 0.05 + 0.06 * np.tan(sink.angle)), (0, 0.06), 800, rng)
    assert straightened([as_patch(*points, sink)]) == []


@pytest.mark.parametrize("seed", [61, 62, 63])
def test_a_rounded_off_groove_is_two_walls_and_a_floor(seed):
    """Walls that lean by 15 degrees, as in a hull, under one label with the floor."""
    rng = np.random.default_rng(seed)
    axis, middle = unit(rng.normal(size=3)), rng.uniform(0.4, 0.6, 3)
    lean = np.radians(75)
    walls = [cone(middle + s * 0.02 * axis, s * axis, 0.1, lean) for s in (-1, 1)]
    depth = 0.03
    parts = [
        turned(walls[0], axis, middle, (0.1, 0.1 + depth), (-0.02, -0.02 - depth / np.tan(lean)), 400, rng),
        turned(cylinder(middle, axis, 0.1), axis, middle, (0.1, 0.1), (-0.02, 0.02), 700, rng),
        turned(walls[1], axis, middle, (0.1, 0.1 + depth), (0.02, 0.02 + depth / np.tan(lean)), 400, rng),
    ]
    xyz, normals = (np.concatenate([p[k] for p in parts]) for k in (0, 1))
    own = fit_robust("torus", xyz, normals, NOISE)[0]
    patch = as_patch(xyz, normals, own)
    (change,) = grooved([patch])
    by_height = sorted(change.new, key=lambda p: float((p.xyz.mean(axis=0) - middle) @ axis))
    assert [p.surface.kind for p in by_height] == ["plane", "cylinder", "plane"]
    assert by_height[1].surface.radius == pytest.approx(0.1, abs=0.002)
    heights = [float((p.surface.origin - middle) @ axis) for p in (by_height[0], by_height[2])]
    np.testing.assert_allclose(heights, [-0.024, 0.024], atol=0.003)
    assert float(by_height[0].surface.axis @ axis) > 0.999 > -0.999 > float(by_height[2].surface.axis @ axis)
    assert len({p.primitive for p in change.new}) == 3


@pytest.mark.parametrize("seed", [71, 72])
def test_a_half_round_groove_stays_a_torus(seed):
    rng = np.random.default_rng(seed)
    ring = torus(np.zeros(3), np.array([0, 0, 1.0]), 0.2, 0.04)
    turn, around = rng.uniform(0, 2 * np.pi, 2000), rng.uniform(np.pi / 2, 3 * np.pi / 2, 2000)
    r, z = 0.2 + 0.04 * np.cos(around), 0.04 * np.sin(around)
    xyz = np.column_stack([r * np.cos(turn), r * np.sin(turn), z]) + rng.normal(0, NOISE, (2000, 3))
    assert grooved([as_patch(xyz, -ring.normals(xyz), fit_robust("torus", xyz, -ring.normals(xyz), NOISE)[0])]) == []


@pytest.mark.parametrize(("angle", "change"), [(80.0, True), (62.0, True), (50.0, False)])
def test_a_cone_that_is_nearly_flat_may_be_a_plane(angle, change):
    rng, axis = np.random.default_rng(1), np.eye(3)[2]
    half = np.radians(angle)
    turn, out = rng.uniform(0, 2 * np.pi, 900), rng.uniform(0.4, 0.5, 900)
    radial = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(900)])
    xyz = out[:, None] * radial - (out / np.tan(half))[:, None] * axis
    normals = np.cos(half) * radial + np.sin(half) * axis
    wall = Patch(cone(np.zeros(3), -axis, 0.0, half), 0, xyz, normals, 0.02, 0.001)
    floor = Patch(plane(np.zeros(3), -axis), 1, out[:, None] * radial, np.tile(-axis, (900, 1)), 0.02, 0.001)
    found = flattened([wall, floor])
    assert bool(found) is change
    if found:
        flat = found[0].new[0].surface
        assert np.allclose(flat.axis, axis)
        assert flat.origin[2] == pytest.approx(-0.45 / np.tan(half), abs=0.002)


@pytest.mark.parametrize(("bend", "change"), [(0.3, True), (1.5, False)])
def test_a_shoulder_whose_points_bend_up_at_its_foot_may_be_a_plane(bend, change):
    """A fillet, which turns by a right angle, is none."""
    rng, axis = np.random.default_rng(2), np.eye(3)[2]
    foot, turn = rng.uniform(0, bend, 900), rng.uniform(0, 2 * np.pi, 900)
    ring = torus(np.zeros(3), axis, 0.5, 0.1)  # its lowest circle is where the points are level
    radial = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(900)])
    xyz = (0.5 - 0.1 * np.sin(foot))[:, None] * radial - (0.1 * np.cos(foot))[:, None] * axis
    normals = np.sin(foot)[:, None] * radial + np.cos(foot)[:, None] * axis
    shoulder = Patch(ring, 0, xyz, normals, 0.02, 0.001)
    top = Patch(plane(0.3 * axis, axis), 1, xyz + 0.4 * axis, np.tile(axis, (900, 1)), 0.02, 0.001)
    found = flattened([shoulder, top])
    assert bool(found) is change
    if found:
        assert np.allclose(found[0].new[0].surface.axis, axis)
        assert found[0].new[0].surface.origin[2] == pytest.approx(-0.1, abs=0.003)


@pytest.mark.parametrize("seed", [51, 52, 53])
def test_a_chamfer_that_bends_at_its_edges_is_a_plane(seed):
    rng = np.random.default_rng(seed)
    along, count = unit(rng.normal(size=3)), 400
    across = unit(np.cross(along, rng.normal(size=3)))
    up = np.cross(along, across)
    x, y = rng.uniform(-0.02, 0.02, count), rng.uniform(-0.3, 0.3, count)
    bent = 0.35 * np.sign(x) * (np.abs(x) > 0.013)  # turned by 20 degrees beside its edges
    middle = rng.uniform(0.4, 0.6, 3)
    xyz = middle + x[:, None] * across + y[:, None] * along - (0.006 * (np.abs(x) / 0.02) ** 6)[:, None] * up
    xyz += rng.normal(0, NOISE / 2, xyz.shape)
    normals = np.cos(bent)[:, None] * up + np.sin(bent)[:, None] * across
    arc = cylinder(middle - 0.05 * up, along, 0.05)
    (change,) = unbent([as_patch(xyz, normals, arc)])
    (new,) = change.new
    assert new.surface.kind == "plane"
    assert new.surface.axis @ up > np.cos(np.radians(4))
    assert abs(new.surface.signed_distance(middle[None])[0]) < 0.003


@pytest.mark.parametrize("flipped", [False, True])
def test_a_fillet_stays_a_cylinder(flipped):
    rng = np.random.default_rng(6)
    angle = rng.uniform(-np.pi / 4, np.pi / 4, 500)
    outward = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(500)])
    xyz = 0.05 * outward + rng.uniform(-0.3, 0.3, 500)[:, None] * [0, 0, 1]
    arc = cylinder(np.zeros(3), np.array([0, 0, 1.0]), 0.05, flipped=flipped)
    assert unbent([as_patch(xyz, arc.normals(xyz), arc)]) == []
