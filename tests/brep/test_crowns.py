"""Fillets all around a flat face under labels that run over, against blocks and pockets whose fillets are known."""

from collections import Counter

import numpy as np
import pytest
from brepgaussian.brep.blends import blended
from brepgaussian.brep.crowns import crowned
from brepgaussian.brep.patches import Patch, supported
from brepgaussian.geometry.rolling import rolling
from brepgaussian.geometry.surfaces import cone, cylinder, plane

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


UPRIGHT = 0.12  # radius of a block's upright edges


def rounded_block(radius, rng):
    """Patches of a block with upright edges rounded off, too: top, 4 walls, 4 round ones, the fillets of these."""
    core = HALF - UPRIGHT
    made = []

    def add(surface, xyz, normals):
        noisy = xyz + NOISE * rng.normal(size=xyz.shape)
        made.append(Patch(surface, len(made), noisy, normals, REACH, surface.rms(noisy)))

    flat = rng.uniform(-HALF, HALF, (6000, 2))
    past = np.linalg.norm(np.maximum(np.abs(flat) - core, 0), axis=1)
    flat = flat[past < UPRIGHT - radius]
    add(TOP, np.column_stack([flat, np.full(len(flat), HIGH)]), np.tile(TOP.axis, (len(flat), 1)))
    turns, rounds = [], []
    for axis, way in SIDES:

        def place(angle, along, axis=axis, way=way):
            out, up = UPRIGHT - radius + radius * np.cos(angle), HIGH - radius + radius * np.sin(angle)
            xyz, normals = np.empty((len(along), 3)), np.zeros((len(along), 3))
            xyz[:, axis], xyz[:, 1 - axis], xyz[:, 2] = way * (core[axis] + out), along * core[1 - axis], up
            normals[:, axis], normals[:, 2] = way * np.cos(angle), np.sin(angle)
            return xyz, normals

        xyz, normals = place(np.zeros(1500), rng.uniform(-1, 1, 1500))
        xyz[:, 2] = rng.uniform(0, HIGH - radius, 1500)
        add(wall_of((axis, way)), xyz, normals)
        turns.append(place(rng.uniform(0, np.pi / 2, 700), rng.uniform(-1, 1, 700)))
    for x in (-1, 1):
        for y in (-1, 1):
            middle = np.array([x * core[0], y * core[1]])

            def around(turn, angle, x=x, y=y, middle=middle):
                out = np.column_stack([x * np.cos(turn), y * np.sin(turn)])
                radial = (UPRIGHT - radius + radius * np.cos(angle))[:, None] * out
                xyz = np.column_stack([middle + radial, HIGH - radius + radius * np.sin(angle)])
                return xyz, np.column_stack([np.cos(angle)[:, None] * out, np.sin(angle)])

            xyz, normals = around(rng.uniform(0, np.pi / 2, 1000), np.zeros(1000))
            xyz[:, 2] = rng.uniform(0, HIGH - radius, 1000)
            add(cylinder([*middle, 0], [0, 0, 1.0], UPRIGHT), xyz, normals)
            rounds.append(around(rng.uniform(0, np.pi / 2, 350), rng.uniform(0, np.pi / 2, 350)))
    return made, turns, rounds


@pytest.mark.parametrize("seed", range(3))
def test_fillets_go_on_around_rounded_corners(seed):
    """Of eight fillets two are known; the others share labels with the walls below, the face, and each other."""
    radius, rng = 0.05, np.random.default_rng(seed)
    patches, turns, rounds = rounded_block(radius, rng)
    for k in (0, 1):
        surface = rolling(TOP, wall_of(SIDES[k]), 1.08 * radius)
        patches.append(Patch(surface, len(patches), *turns[k], REACH, surface.rms(turns[k][0])))
    for owner, more in ((5, rounds[0]), (6, rounds[1]), (0, turns[2])):
        xyz, normals = (
            np.concatenate(pair) for pair in zip((patches[owner].xyz, patches[owner].normals), more, strict=True)
        )
        patches[owner] = supported(patches[owner], patches[owner].surface, xyz, normals)
    xyz, normals = (np.concatenate(parts) for parts in zip(turns[3], rounds[2], rounds[3], strict=True))
    patches.append(
        Patch(cone(xyz.mean(axis=0) - [0, 0, 0.1], [0, 0.6, -0.8], 0.2, 0.6), len(patches), xyz, normals, REACH, 0.01)
    )
    result = around(patches)
    kinds = Counter(p.surface.kind for p in result)
    assert kinds == {"plane": 5, "cylinder": 8, "torus": 4}
    for p in (p for p in result if p.surface.kind == "torus"):
        assert p.surface.minor == pytest.approx(radius, rel=0.1)
        assert p.surface.radius == pytest.approx(UPRIGHT - radius, rel=0.1)
