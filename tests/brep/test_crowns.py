"""Fillets all around a flat face under labels that run over, against blocks and pockets whose fillets are known."""

import numpy as np
import pytest
from brepgaussian.brep.blends import blended
from brepgaussian.brep.crowns import crowned
from brepgaussian.brep.patches import Patch
from brepgaussian.geometry.rolling import rolling
from brepgaussian.geometry.surfaces import cone, plane

HALF, HIGH, NOISE, REACH = np.array([0.5, 0.3]), 0.4, 0.0006, 0.012
TOP = plane([0, 0, HIGH], [0, 0, 1.0])
SIDES = [(axis, way) for axis in (0, 1) for way in (-1, 1)]


def wall_of(side):
    axis, way = side
    normal = way * np.eye(3)[axis]
    return plane(normal * HALF[axis], normal)


def on_fillet(side, radius, rng, count):
    """Points and normals of a fillet that ends in the mitres at its corners."""
    axis, way = side
    angle = rng.uniform(0, np.pi / 2, count)
    back = radius * (1 - np.cos(angle))  # from the wall
    along = rng.uniform(-1, 1, count) * (HALF[1 - axis] - back)
    xyz, normals = np.empty((count, 3)), np.zeros((count, 3))
    xyz[:, axis], xyz[:, 1 - axis], xyz[:, 2] = way * (HALF[axis] - back), along, HIGH - radius * (1 - np.sin(angle))
    normals[:, axis], normals[:, 2] = way * np.cos(angle), np.sin(angle)
    return xyz, normals


def block(radii, rng):
    """Points and normals of the top, the four walls and the fillets between them; a radius of 0 is a sharp edge."""
    inset = dict(zip(SIDES, radii, strict=True))
    low = np.array([-HALF[a] + inset[a, -1] for a in (0, 1)])
    high = np.array([HALF[a] - inset[a, 1] for a in (0, 1)])
    parts = [(np.column_stack([rng.uniform(low, high, (3000, 2)), np.full(3000, HIGH)]), np.tile(TOP.axis, (3000, 1)))]
    for side in SIDES:
        axis, way = side
        wall = wall_of(side)
        xyz = np.empty((2500, 3))
        xyz[:, axis], xyz[:, 1 - axis] = way * HALF[axis], rng.uniform(-1, 1, 2500) * HALF[1 - axis]
        xyz[:, 2] = rng.uniform(0, HIGH - inset[side], 2500)
        parts.append((xyz, np.tile(wall.axis, (2500, 1))))
    for side in SIDES:
        count = int(40000 * inset[side] * HALF[1 - side[0]])
        parts.append(on_fillet(side, inset[side], rng, count) if count else (np.zeros((0, 3)), np.zeros((0, 3))))
    return [(xyz + NOISE * rng.normal(size=xyz.shape), normals) for xyz, normals in parts]


def labelled(parts, radius, groups, turned=False):
    """Patches of groups of parts: of the top, of walls, of fillets, or of several of these, which a cone explains.

    `turned`: of the hollow that the block leaves, with normals the other way.
    """
    made = []
    for number, group in enumerate(groups):
        xyz, normals = (np.concatenate([parts[k][i] for k in group]) for i in (0, 1))
        main = group[0]
        if main == 0:
            surface = TOP
        elif main < 5:
            surface = wall_of(SIDES[main - 1])
        elif len(group) == 1:
            surface = rolling(TOP, wall_of(SIDES[main - 5]), 1.08 * radius)
        else:
            surface = cone(xyz.mean(axis=0) - [0, 0, 0.1], [0, 0.6, -0.8], 0.2, 0.6)
        if turned:
            surface = plane(surface.origin, -surface.axis) if surface.kind == "plane" else surface.flip()
            normals = -normals
        made.append(Patch(surface, number, xyz, normals, REACH, surface.rms(xyz)))
    return made


def around(patches):
    """The patches after the only change."""
    (change,) = crowned(patches, NOISE)
    kept = [p for i, p in enumerate(patches) if i not in change.gone]
    return [*kept, *change.new]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("turned", [False, True])
def test_two_fillets_under_one_label_and_one_in_the_face_come_apart(seed, turned):
    radius = 0.06
    parts = block([radius] * 4, np.random.default_rng(seed))
    patches = labelled(parts, radius, [(0, 7), (1,), (2,), (3,), (4,), (5,), (6, 8)], turned)
    result = around(patches)
    fillets = [p for p in result if p.surface.kind == "cylinder"]
    assert len(fillets) == 4
    for p in fillets:
        assert p.surface.flipped == turned
        assert p.surface.radius == pytest.approx(radius, rel=0.1)
    owners = {(len(b.faces), tuple(sorted(b.faces))) for b in blended(result, NOISE)[1]}
    assert len(owners) == 4  # each between the face and a wall of its own
    (top,) = [p for p in result if p.surface.kind == "plane" and abs(p.surface.axis[2]) > 0.9]
    assert np.quantile(np.abs(top.xyz[:, :2]), 0.99, axis=0) == pytest.approx(HALF - radius, abs=0.2 * radius)


def test_no_point_is_lost_but_those_of_labels_that_were_none():
    radius = 0.06
    parts = block([radius] * 4, np.random.default_rng(5))
    patches = labelled(parts, radius, [(0, 7), (1,), (2,), (3,), (4,), (5,), (6, 8)])
    before, after = (np.unique(np.concatenate([p.xyz for p in some]), axis=0) for some in (patches, around(patches)))
    assert len(after) > 0.99 * len(before)


def test_sharp_edges_stay_sharp():
    radius = 0.06
    parts = block([radius, radius, 0.0, radius], np.random.default_rng(6))
    patches = labelled(parts, radius, [(0,), (1,), (2,), (3,), (4,), (5,), (6, 8)])
    result = around(patches)
    assert sum(p.surface.kind == "cylinder" for p in result) == 3
    fronts = [result[i].surface.axis[1] for b in blended(result, NOISE)[1] for i in b.faces]
    assert min(fronts) > -0.9  # none at the wall that looks that way


@pytest.mark.parametrize("radii", [[0.06] * 4, [0.06, 0.0, 0.0, 0.0], [0.0] * 4, [0.06, 0.06, 0.0, 0.0]])
def test_right_labels_are_left_alone(radii):
    parts = block(radii, np.random.default_rng(7))
    groups = [(k,) for k, part in enumerate(parts) if len(part[0])]
    assert crowned(labelled(parts, 0.06, groups), NOISE) == []
